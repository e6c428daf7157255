#pragma once

#include <array>
#include <string>
#include <vector>

#include "estimator/identification/identification.hpp"

namespace vibrig::estimator::commissioning {

/// What a dwell is to the question whether a configuration is its rig's. Allocates nothing.
struct DwellMean {
    std::array<double, 3> encoder_rad{};  ///< mean readings
    std::array<double, 3> slope_deg_h{};  ///< of the readings
    /// Variance of the slopes, by the readings' scatter about them, (deg/h)^2; 0: not known.
    std::array<double, 3> slope_variance{};
    double begin_s = 0, duration_s = 0;  ///< on the recording's clock
    std::array<double, 3> force_g{};     ///< raw mean; of vibration only its mean is left
    double kappa = 1;
    bool level_known = true;  ///< else kappa means nothing, and the slopes are left out
};

/// Sums up a dwell. Samples that are not good or not finite are left out.
class DwellMeans {
  public:
    void add(const Measurement& measurement) noexcept;
    /// Half a second of samples at least, over some time.
    [[nodiscard]] bool known() const noexcept;
    [[nodiscard]] DwellMean mean(double kappa, bool level_known) const noexcept;

  private:
    double count_ = 0, t_ = 0, tt_ = 0, first_s_ = 0;
    double last_s_ = 0;
    std::array<double, 3> first_{}, last_{}, a_{}, aa_{}, ta_{}, force_{};
};

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
