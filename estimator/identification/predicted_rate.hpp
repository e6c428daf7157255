#pragma once

#include <array>
#include <vector>

#include "estimator/filter/settings.hpp"
#include "estimator/filter/vibration_moment.hpp"

namespace vibrig::estimator {

/// Rate of the free platform relative to the Earth, platform axes, as the coefficients have it.
struct PredictedRate {
    std::array<double, 3> rate_deg_h{};
    /// What the coefficients' covariance leaves open; the diagonal is also that of gyro x, y, z.
    std::array<std::array<double, 3>, 3> covariance{};
};

/// `coefficients` and `covariance` (30 x 30, row-major) in the order of parameter_names(); encoder
/// angles.
[[nodiscard]] PredictedRate predicted_rate(const Settings& settings,
                                           const std::array<double, kParameters>& coefficients,
                                           const std::vector<double>& covariance,
                                           const std::array<double, 3>& encoder_rad,
                                           const VibrationMoment& vibration);

}  // namespace vibrig::estimator
