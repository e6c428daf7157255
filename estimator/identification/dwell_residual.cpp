#include "estimator/identification/dwell_residual.hpp"

#include <Eigen/LU>

#include "estimator/filter/drift_model.hpp"
#include "estimator/filter/second_moment.hpp"

namespace vibrig::estimator {

DwellResidual dwell_residual(const Settings& settings,
                             const std::array<double, kParameters>& coefficients,
                             const VibrationMoment& vibration, std::span<const AngleBlock> blocks) {
    DwellResidual residual;
    if (blocks.empty()) return residual;
    const Kinematics kinematics(settings);
    const DriftModel model(settings);
    ParameterArray parameters{};
    for (std::size_t i = 0; i < kParameters; ++i) parameters[internal_of(i)] = coefficients[i];
    const auto rate = [&](const Eigen::Vector3d& angles) -> Eigen::Vector3d {  // arcsec/s
        const Pose pose = kinematics.pose(angles);
        const Regressors h = model.regressors(pose.up, second_moment(pose, vibration));
        return pose.m * model.platform_rate(pose, h, parameters.data());
    };

    // A turn of the platform within the dwell changes the axes by 1e-2 at most: one pose for all.
    const Eigen::Vector3d middle = kinematics.gimbal_angles(blocks[blocks.size() / 2].angle_rad);
    const Eigen::Matrix3d to_gyros = model.drift_sign() * kinematics.pose(middle).m.inverse();
    for (Eigen::Index k = 0; k < 3; ++k) {
        residual.noise_gain[static_cast<std::size_t>(k)] = to_gyros.row(k).squaredNorm();
    }
    const Eigen::Vector3d start = kinematics.gimbal_angles(blocks.front().angle_rad);
    Eigen::Vector3d angles = start;
    double time = blocks.front().time_s;
    for (const AngleBlock& block : blocks) {
        const double dt = block.time_s - time;
        time = block.time_s;
        const Eigen::Vector3d half = angles + 0.5 * dt / kArcsecPerRad * rate(angles);
        angles += dt / kArcsecPerRad * rate(half);
        const Eigen::Vector3d measured = kinematics.gimbal_angles(block.angle_rad);
        Eigen::Vector3d left;
        for (Eigen::Index k = 0; k < 3; ++k) left[k] = wrap(measured[k] - angles[k]);
        left = kArcsecPerRad * (to_gyros * left);
        for (std::size_t k = 0; k < 3; ++k) {
            residual.angle_arcsec[k].push_back(left[static_cast<Eigen::Index>(k)]);
        }
    }
    return residual;
}

}  // namespace vibrig::estimator
