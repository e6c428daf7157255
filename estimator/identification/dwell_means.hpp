#pragma once

#include <array>

#include "estimator/filter/measurement.hpp"

namespace vibrig::estimator {

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

}  // namespace vibrig::estimator
