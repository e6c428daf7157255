function campaign = open(path)
%OPEN  A recorded campaign, all its parts joined in their order.
%
%   c = vibrig.open('demo-20261121T181334Z')
%
%   PATH is the campaign's folder, or one of its HDF5 files. Tables are structs of columns with a row for each row of
%   the file (samples.force_g is n x 3); their times are ns of the first part's clock, UTC is those plus utc_offset_ns:
%     c.samples, c.orders, c.dwells, c.estimates, c.conditions, c.events, c.gaps
%     c.units.samples.force_g      unit of a column, where the file has one
%     c.coefficients               names, unit, value, u, sigma (30 x 1), covariance (30 x 30), observable; after the last
%                                  dwell; NaN: not determined; u is the standard uncertainty, by the result's combined
%                                  covariance (NaN without one: covariance is of noise alone then); sigma the filter's noise
%                                  alone, over frequency that of the reference frequency's fit
%     c.verdict                    of the result; [] without one
%     c.result, c.plan, c.interlocks, c.configuration (text), c.state, c.name
%
%   In MATLAB and in GNU Octave. See also VIBRIG.COMPENSATION.
parts = part_files(path);
campaign = vibrig.internal.read_part(parts{1});
for i = 2:numel(parts)
  campaign = vibrig.internal.join_parts(campaign, vibrig.internal.read_part(parts{i}), i);
end
refuse_missing_end(parts, campaign.state);
campaign.parts = parts;
campaign.coefficients = coefficients_of(campaign);
campaign.verdict = [];
if isfield(campaign.result, 'verdict'), campaign.verdict = campaign.result.verdict; end
campaign = rmfield(campaign, {'head', 'moved'});
end

function parts = part_files(path)
if exist(path, 'dir')
  folder = path;
elseif exist(path, 'file')
  [folder, name] = fileparts(path);
  if isempty(regexp(name, '^campaign(-[0-9]+)?$', 'once'))
    parts = {path};   % a file of another name stands for itself
    return
  end
else
  error('vibrig:missing', '%s: found nothing, expected a campaign''s HDF5 file or its folder', path);
end
found = dir(fullfile(folder, 'campaign*.h5'));
numbers = cellfun(@(name) part_number(name), {found.name});
numbers = sort(numbers(numbers > 0));
if isempty(numbers)
  error('vibrig:missing', '%s: found no campaign.h5 in it, expected one', path);
end
missing = setdiff(1:max(numbers), numbers);
if ~isempty(missing)
  error('vibrig:missing', '%s: missing part %d, expected all %d parts', path, missing(1), max(numbers));
end
parts = arrayfun(@(number) fullfile(folder, part_name(number)), numbers, 'UniformOutput', false);
end

function refuse_missing_end(parts, state)
% A part is called continued once the next file is there, which may have come since the files were looked for.
[folder, name, ending] = fileparts(parts{end});
count = numel(parts);
if ~strcmp(state, 'continued') || ~strcmp([name ending], part_name(count)), return, end
if ~exist(fullfile(folder, part_name(count + 1)), 'file')
  error('vibrig:missing', '%s: missing %s, in which %s says that the campaign goes on', folder, part_name(count + 1), part_name(count));
end
end

function name = part_name(number)
if number == 1, name = 'campaign.h5'; else, name = sprintf('campaign-%d.h5', number); end
end

function number = part_number(name)
number = 0;
token = regexp(name, '^campaign-([0-9]+)\.h5$', 'tokens', 'once');
if strcmp(name, 'campaign.h5')
  number = 1;
elseif ~isempty(token) && strcmp(part_name(str2double(token{1})), name)
  number = str2double(token{1});
end
end

function c = coefficients_of(campaign)
terms = {'F', 'I', 'O', 'S', 'II', 'OO', 'SS', 'IO', 'IS', 'OS'};
units = [{'deg/h'}, repmat({'deg/h/g'}, 1, 3), repmat({'deg/h/g^2'}, 1, 6)];
c.names = cell(30, 1);
c.unit = repmat(units(:), 3, 1);
gyros = 'xyz';
for gyro = 1:3
  for k = 1:10, c.names{10 * (gyro - 1) + k} = ['D_' terms{k} gyros(gyro)]; end
end
c.value = nan(30, 1); c.sigma = nan(30, 1); c.u = nan(30, 1); c.covariance = nan(30, 30); c.observable = false(30, 1);
if isempty(campaign.dwells.time_ns), return, end
seen = campaign.dwells.observable(end, :)' ~= 0;
c.observable = seen;
value = campaign.dwells.value(end, :)'; sigma = campaign.dwells.sigma(end, :)';
covariance = reshape(campaign.dwells.covariance(end, :, :), 30, 30);
combined = isfield(campaign.result, 'covariance_combined') && isnumeric(campaign.result.covariance_combined) ...
    && isequal(size(campaign.result.covariance_combined), [30 30]);
if combined
  % The result's own, with drift states and declared inputs.
  covariance = campaign.result.covariance_combined;
  for i = 1:30
    one = campaign.result.parameters(i).value;
    if ~isempty(one), value(i) = one; end
  end
end
c.value(seen) = value(seen); c.sigma(seen) = sigma(seen); c.covariance(seen, seen) = covariance(seen, seen);
if combined, c.u = sqrt(diag(c.covariance)); end
end
