#pragma once

#include <numbers>

#include "estimator/filter/kinematics.hpp"

namespace vibrig::estimator {

/// Drift over the vibration's power, deg/h/g^2, of a platform that turns about two axes by so much
/// at the vibration's frequency, a quarter period apart: the most that motion in step with it does.
/// `peak_square_g2`: of the acceleration (docs/theory/uncertainty.md).
[[nodiscard]] inline double coning_bound(double hz, double arcsec, double peak_square_g2) noexcept {
    const double turn = arcsec / kArcsecPerRad;
    return 2 * std::numbers::pi * hz * turn * turn * kArcsecPerRad / peak_square_g2;
}

}  // namespace vibrig::estimator
