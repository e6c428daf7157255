function part = read_part(path)
%READ_PART  One file of a campaign as it is; rows first.
persistent octave
if isempty(octave), octave = exist('OCTAVE_VERSION', 'builtin') ~= 0; end
try
  if octave, raw = load('-hdf5', path); else, raw = read_with_matlab(path); end
catch cause
  error('vibrig:format', '%s: found no HDF5 file that can be read (%s), expected a campaign''s', path, cause.message);
end
if ~isfield(raw, 'samples') || ~isfield(raw, 'configuration')
  error('vibrig:format', '%s: found an HDF5 file without samples, expected a campaign''s', path);
end
part.head = struct();
if isfield(raw, 'head'), part.head = jsondecode(text_of(raw.head)); end
part.path = path;
part.configuration = text_of(raw.configuration);
part.dbc = text_of(raw.dbc);
for name = {'plan', 'result', 'interlocks'}
  part.(name{1}) = struct();
  if isfield(raw, name{1}) && ~isempty(text_of(raw.(name{1})))
    part.(name{1}) = jsondecode(text_of(raw.(name{1})));
  end
end
part.units = struct();
if isfield(part.head, 'units'), part.units = part.head.units; end
for name = {'name', 'campaign'}
  part.(name{1}) = '';
  if isfield(part.head, name{1}), part.(name{1}) = part.head.(name{1}); end
end
part.channels = {'outer'; 'inner'; 'azimuth'; 'accel_x'; 'accel_y'; 'accel_z'; 'table_accel'};
if isfield(part.head, 'channels'), part.channels = part.head.channels(:); end
part.state = 'running';
part.mark = '';
if isfield(raw, 'ended')
  ended = jsondecode(text_of(raw.ended));
  part.state = ended.state;
  part.mark = ended.mark;
end
part.utc_offset_ns = int64(0);
if isfield(part.head, 'utc_offset_ns'), part.utc_offset_ns = vibrig.internal.int64_of(part.head.utc_offset_ns); end
part.moved = int64(0);
for name = {'samples', 'orders', 'dwells', 'estimates', 'conditions', 'events', 'gaps'}
  part.(name{1}) = struct();
  if isfield(raw, name{1}), part.(name{1}) = table_of(raw.(name{1})); end
end
part = with_its_channels(part);
end

function part = with_its_channels(part)
% Before recordings named their channels they had these, or the first of them.
if ~isfield(part.samples, 'quality') || isempty(part.samples.quality), return, end
width = size(part.samples.quality, 2);
named = isfield(part.head, 'channels');
if width > numel(part.channels) || (named && width < numel(part.channels))
  error('vibrig:format', '%s: samples/quality: found %d numbers in a row, expected %d: %s', part.path, width, ...
        numel(part.channels), strjoin(part.channels, ' '));
end
part.channels = part.channels(1:width);
end

function table = table_of(raw)
% HDF5's first dimension comes last. A table that grows meanwhile is as long as its shortest column.
table = struct(); rows = Inf; one = false;
for name = {'time_ns', 'from_ns'}
  if isfield(raw, name{1}), one = numel(raw.(name{1})) == 1; end
end
for name = fieldnames(raw)'
  values = raw.(name{1});
  if ischar(values) || iscell(values)
    values = texts_of(values);
  elseif one && isvector(values)
    values = values(:).';
  elseif one   % of a single row the last dimension is gone
    values = permute(values, [3 2 1]);
  elseif ~isvector(values) && ~isempty(values)
    values = permute(values, ndims(values):-1:1);
  else
    values = values(:);
  end
  if isa(values, 'int64'), rows = min(rows, whole_rows(values)); end
  rows = min(rows, size(values, 1));
  table.(name{1}) = values;
end
for name = fieldnames(table)'
  values = table.(name{1});
  if size(values, 1) > rows, table.(name{1}) = values(1:rows, :, :); end
end
end

function rows = whole_rows(values)
% The rest never reached the disk.
rows = size(values, 1);
unwritten = find(any(values(:, :) == intmin('int64'), 2), 1);
if ~isempty(unwritten), rows = unwritten - 1; end
end

function text = text_of(raw)
if iscell(raw), raw = raw{1}; end
text = char(raw);
text = text(:)';
text(text == 0) = [];
end

function texts = texts_of(raw)
if iscell(raw), texts = raw(:); return, end
texts = cell(size(raw, 1), 1);
for i = 1:size(raw, 1)
  line = raw(i, :);
  texts{i} = strtrim(line(line ~= 0));
end
end

function raw = read_with_matlab(path)
info = h5info(path);
raw = struct();
for dataset = info.Datasets'
  raw.(dataset.Name) = h5read(path, ['/' dataset.Name]);
end
for group = info.Groups'
  name = group.Name(2:end);
  raw.(name) = struct();
  for dataset = group.Datasets'
    raw.(name).(dataset.Name) = h5read(path, [group.Name '/' dataset.Name]);
  end
end
end
