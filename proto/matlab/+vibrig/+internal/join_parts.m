function to = join_parts(to, part, number)
%JOIN_PARTS  PART behind what there is, as daemon/record/campaign_parts.cpp does it.
if ~isfield(part.head, 'restart')
  error('vibrig:format', '%s: found no /head in it, expected one to join it with the parts before; vibrig export joins them', ...
        part.path);
end
if part.head.part ~= number || ~strcmp(part.campaign, to.campaign)
  error('vibrig:format', '%s: found part %d of %s, expected part %d of %s', part.path, part.head.part, part.campaign, ...
        number, to.campaign);
end
[to, part] = same_channels(to, part);
last = int64(0);
if ~isempty(to.samples.time_ns), last = to.samples.time_ns(end); end
if part.head.restart
  shift = part.utc_offset_ns - to.utc_offset_ns;
  % UTC may have been set back meanwhile; dwells only know differences.
  if ~isempty(part.samples.time_ns) && last > 0 && part.samples.time_ns(1) + shift <= last
    shift = last + int64(1e9) - part.samples.time_ns(1);
  end
  to.moved = shift;
  part = moved(part, shift);
  to = cut_back(to, part.head.dwells_before);
else
  part = moved(part, to.moved);   % the same life of the daemon, and so the same clock
  % The disk refused meanwhile: of what was kept for this file some may be in the other, too.
  if last > 0, part.samples = rows_of(part.samples, part.samples.time_ns > last); end
  both = @(orders) [orders.announced_ns(:), int64(orders.cancel(:))];
  if ~isempty(to.orders.announced_ns) && ~isempty(part.orders.announced_ns)
    part.orders = rows_of(part.orders, ~ismember(both(part.orders), both(to.orders), 'rows'));
  end
  if ~isempty(to.dwells.time_ns)
    part.dwells = rows_of(part.dwells, part.dwells.time_ns > to.dwells.time_ns(end));
  end
end
for name = {'samples', 'orders', 'dwells', 'estimates', 'conditions', 'events', 'gaps'}
  to.(name{1}) = behind(to.(name{1}), part.(name{1}));
end
for name = {'state', 'mark', 'result'}, to.(name{1}) = part.(name{1}); end
end

function [to, part] = same_channels(to, part)
% A part of another build may have fewer channels, or others.
if isequal(to.channels, part.channels), return, end
all = [to.channels; setdiff(part.channels, to.channels)];
to = by_channel(to, all);
part = by_channel(part, all);
end

function part = by_channel(part, channels)
if isfield(part.samples, 'quality')
  found = part.samples.quality;
  unbound = 5;
  part.samples.quality = repmat(cast(unbound, class(found)), size(found, 1), numel(channels));
  [~, places] = ismember(part.channels, channels);
  if ~isempty(found), part.samples.quality(:, places) = found; end
end
part.channels = channels;
end

function part = moved(part, by)
for name = {'samples', 'orders', 'dwells', 'estimates', 'conditions', 'events', 'gaps'}
  for column = {'time_ns', 'announced_ns', 'from_ns', 'to_ns'}
    if isfield(part.(name{1}), column{1})
      part.(name{1}).(column{1}) = part.(name{1}).(column{1}) + by;
    end
  end
end
end

function to = cut_back(to, before)
% Forgets what came after the first dwells that the filter had: it was not done again from there.
heard = cumsum(double(to.dwells.samples > 0));
kept = find(heard >= before, 1);
if before == 0, kept = 0; elseif isempty(kept), kept = numel(heard); end
orders = 0; done = 0;
for i = 1:numel(to.orders.run)
  if done == kept, break, end
  if to.orders.cancel(i) || to.orders.run(i) ~= to.dwells.run(done + 1) || ...
      to.orders.position(i) ~= to.dwells.position(done + 1), continue, end
  done = done + 1;
  orders = i;
  if i < numel(to.orders.run) && to.orders.cancel(i + 1), orders = i + 1; end
end
to.dwells = rows_of(to.dwells, (1:numel(heard))' <= kept);
to.orders = rows_of(to.orders, (1:numel(to.orders.run))' <= orders);
end

function table = rows_of(table, which)
for name = fieldnames(table)'
  values = table.(name{1});
  table.(name{1}) = values(which(:), :, :);
end
end

function to = behind(to, more)
if isempty(fieldnames(to)), to = more; return, end
if isempty(fieldnames(more)), return, end
for name = fieldnames(to)'
  if ~isfield(more, name{1}) || size(more.(name{1}), 1) == 0, continue, end
  if size(to.(name{1}), 1) == 0
    to.(name{1}) = more.(name{1});
  else
    to.(name{1}) = [to.(name{1}); more.(name{1})];
  end
end
end
