#pragma once

#include "estimator/filter/measurement.hpp"

namespace vibrig::estimator {

/// Relative standard error of the mean square of a random vibration up to `highest_hz` over `n`
/// samples: they are independent when they are slow, and know everything when they are fast.
[[nodiscard]] double realised_error(double n, double sample_hz, double highest_hz) noexcept;

/// The level of a dwell under random vibration, from the vertical specific force: plain means,
/// since a window would throw independent samples away.
class RandomLevel {
  public:
    void add(double vertical_force_g) noexcept;

    struct Level {
        double mean_square_g2 = 0;  ///< of samples and profile, each by its own certainty
        double relative_error = 0;  ///< of that, 1 sigma
        double mean_force_g = 0, mean_force_sigma_g = 0;
        double sigmas_apart = 0;  ///< of samples and profile
    };
    /// `noise_g`: of one reading; `span_s`: of the dwell, in which the profile's realisation
    /// strays.
    [[nodiscard]] Level level(const RandomVibration& profile, double noise_g, double period_s,
                              double span_s) const noexcept;

  private:
    double count_ = 0, sum_ = 0, square_ = 0;  ///< about 1 g
};

}  // namespace vibrig::estimator
