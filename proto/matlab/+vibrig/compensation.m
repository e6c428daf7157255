function [drift, residual, determined] = compensation(campaign, attitude_deg, varargin)
%COMPENSATION  What the gyros drift at an attitude under vibration, and what compensation leaves.
%
%   [drift, residual, determined] = vibrig.compensation(c, [45 0 90], 'table_g', 9)
%
%   ATTITUDE_DEG are gimbal angles outer, inner, azimuth (no encoder readings); 'table_g' or 'platform_g' the peak of the
%   vibration, neither: at rest. DRIFT and RESIDUAL (1 sigma) are deg/h about the input axes of gyros x, y, z (3 x 1), as `vibrig compensate`
%   gives them, and NaN where not DETERMINED by the data. Quadratic coefficients that depend on the frequency foretell no
%   vibration: then the level must be 0.
%   They are h.D and sqrt(h'Ph) of Tang et al. 2009, eqs 8-9 with k1 = 1, k2 = 1 + a^2 / 2.
if numel(attitude_deg) ~= 3 || ~all(isfinite(attitude_deg))
  error('vibrig:argument', 'attitude_deg: expected three angles, deg');
end
level = 0;
for i = 1:2:numel(varargin)
  switch varargin{i}
    case 'table_g', level = varargin{i + 1} * value_of(campaign, 'vibration.transmission');
    case 'platform_g', level = varargin{i + 1};
    otherwise, error('vibrig:argument', 'found %s, expected table_g or platform_g', varargin{i});
  end
end
if ~(level >= 0 && level <= 1000)
  error('vibrig:argument', 'level: found %g, expected 0 to 1000 g', level);
end
if level > 0 && isfield(campaign.result, 'spectrum') && depends_on_frequency(campaign.result.spectrum)
  error('vibrig:argument', ['found quadratic coefficients that depend on the frequency, expected a level of 0 ' ...
                            '(vibrig predict has the drift under a vibration)']);
end
kappa = 1 + level^2 / 2;
a = attitude_deg(1); b = attitude_deg(2); g = attitude_deg(3);
rx = [1 0 0; 0 cosd(a) -sind(a); 0 sind(a) cosd(a)];
ry = [cosd(b) 0 sind(b); 0 1 0; -sind(b) 0 cosd(b)];
rz = [cosd(g) -sind(g) 0; sind(g) cosd(g) 0; 0 0 1];
up = rz * ry * rx * axis_of(value_of(campaign, 'platform.up'));
of = campaign.coefficients;
drift = nan(3, 1); residual = nan(3, 1); determined = true(3, 1);
gyros = 'xyz';
for gyro = 1:3
  names = value_of(campaign, ['platform.gyro_' gyros(gyro) '_axes']);
  i = axis_of(names{1})' * up; o = axis_of(names{2})' * up; s = axis_of(names{3})' * up;
  h = [1; i; o; s; kappa * [i^2; o^2; s^2; i * o; i * s; o * s]];
  own = 10 * (gyro - 1) + find(abs(h) > 1e-9);
  h = h(abs(h) > 1e-9);
  determined(gyro) = all(of.observable(own));
  if ~determined(gyro), continue, end
  drift(gyro) = h' * of.value(own);
  residual(gyro) = sqrt(max(0, h' * of.covariance(own, own) * h));
end
end

function depends = depends_on_frequency(spectrum)
depends = isfield(spectrum, 'model') && ~strcmp(spectrum.model, 'flat') ...
    || isfield(spectrum, 'refusal') && ~isempty(spectrum.refusal) ...
    || isfield(spectrum, 'flat') && isfield(spectrum.flat, 'alarm') && any(spectrum.flat.alarm);
end

function value = value_of(campaign, key)
% Of the effective configuration, a line for each key.
line = regexp(campaign.configuration, ['(^|\n)' strrep(key, '.', '\.') '\s*=\s*([^#\n]*)'], 'tokens', 'once');
if isempty(line), error('vibrig:format', '%s: found nothing in the configuration, expected a value', key); end
value = jsondecode(strtrim(line{end}));
if isnumeric(value), value = value(:)'; end
end

function axis = axis_of(name)
axis = zeros(3, 1);
axis('xyz' == name(2)) = 1 - 2 * (name(1) == '-');
end
