#pragma once

#include "estimator/levelling/design.hpp"

namespace vibrig::estimator::levelling {

/// 1 sigma.
struct Noise {
    double reference_mps = 0;       ///< of the reference velocity, per sample
    double accelerometer_mps2 = 0;  ///< per sample
    double gyro_random_walk = 0;    ///< rad/sqrt(s)
};

/// Standard deviations of the steady tilt, rad.
struct NoiseBudget {
    double reference = 0;
    double accelerometer = 0;
    double gyro = 0;
    double total = 0;
    double drift = 0;  ///< of the drift that z shows, rad/s
    /// Sigma of w without the white part that the newest reference velocity is in it, m/s.
    double velocity = 0;

    [[nodiscard]] const char* dominant() const noexcept;
};

/// Variance of (c2 s^2 + c1 s + c0) / (s^3 + d2 s^2 + d1 s + d0) to white input of unit two-sided
/// density.
[[nodiscard]] double variance_gain(double c2, double c1, double c0, double d2, double d1,
                                   double d0) noexcept;
[[nodiscard]] NoiseBudget noise_budget(const Gains& gains, const Noise& noise, double period_s,
                                       const Earth& earth = {}) noexcept;

}  // namespace vibrig::estimator::levelling
