#pragma once

#include <Eigen/Core>

#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/product.hpp"
#include "estimator/filter/vibration_moment.hpp"

namespace vibrig::estimator {

/// Mean of f f' over a vibration, platform axes, g^2: u u' + (kappa - 1) C Gamma C'. Along the
/// vertical alone it is kappa u u'.
[[nodiscard]] inline Eigen::Matrix3d second_moment(const Pose& pose,
                                                   const VibrationMoment& vibration) noexcept {
    const double excess = vibration.kappa - 1.0;
    const LevelTensor& g = vibration.gamma;
    Eigen::Matrix3d level;
    level << excess * g[0], excess * g[3], excess * g[4],   //
        excess * g[3], 1.0 + excess * g[1], excess * g[5],  //
        excess * g[4], excess * g[5], excess * g[2];
    return product(product(pose.level, level), pose.level.transpose());
}

}  // namespace vibrig::estimator
