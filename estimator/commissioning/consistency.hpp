#pragma once

#include <string>
#include <vector>

#include "estimator/filter/settings.hpp"
#include "estimator/identification/dwell_means.hpp"

namespace vibrig::estimator::commissioning {

struct ConsistencyLimits {
    double gravity_deg = 0.5;  ///< vertical by the encoders against the mean force
    double earth_deg_h = 0.1;  ///< north and east against the site, or 5 sigma
    /// Rms of what 30 coefficients and the Earth leave, or 5 sigma of the noise's own.
    double rest_deg_h = 0.2;
    double input_mean_deg_h_g = 5;  ///< mean of the three input-axis terms
    std::size_t dwells = 9;         ///< before, the Earth rate is not observable in Table 1
};

/// A configuration held against the dwells measured with it.
struct Consistency {
    double gravity_deg = 0;  ///< worst dwell
    bool earth_known = false;
    double north_deg_h = 0, east_deg_h = 0;  ///< measured less what the site's keys say
    double sigma_deg_h = 0;                  ///< the larger of both
    double rest_deg_h = 0;
    double input_mean_deg_h_g = 0;
    std::vector<std::string> contradictions;  ///< empty: it fits
};
/// Throws SettingsError.
[[nodiscard]] Consistency consistency(const Settings& settings,
                                      const std::vector<DwellMean>& dwells,
                                      const ConsistencyLimits& limits = {});

/// A single change that would bring a contradicting configuration within the limits.
struct Suspect {
    std::string words;       ///< "platform.encoder_sign: [1, -1, 1] instead of [1, 1, 1]"
    double cost = 0;         ///< -2 ln likelihood with it
    Settings settings;       ///< with it
    double time_factor = 1;  ///< slopes are too large by that
};
/// Best first, `most` at most: encoder signs and zeros, order and signs of the accelerometers,
/// platform.up, elevation, sign of the latitude, latitude, azimuth, unit of time
/// (docs/commissioning.md).
[[nodiscard]] std::vector<Suspect> suspects(const Settings& settings,
                                            const std::vector<DwellMean>& dwells,
                                            const ConsistencyLimits& limits = {},
                                            std::size_t most = 3);

}  // namespace vibrig::estimator::commissioning
