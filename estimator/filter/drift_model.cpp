#include "estimator/filter/drift_model.hpp"

#include <Eigen/Geometry>

namespace vibrig::estimator {

DriftModel::DriftModel(const Settings& settings) : axes_{}, sign_(settings.drift_sign) {
    for (std::size_t j = 0; j < kGyros; ++j) {
        for (std::size_t k = 0; k < 3; ++k) {
            axes_[j].axis[k] = settings.gyro_axes[j][k].axis;
            axes_[j].sign[k] = settings.gyro_axes[j][k].sign;
        }
    }
}

Regressors DriftModel::regressors(const Eigen::Vector3d& up, double kappa) const noexcept {
    Regressors h{};
    for (std::size_t j = 0; j < kGyros; ++j) {
        const GyroAxes& g = axes_[j];
        const double i = g.sign[0] * up[g.axis[0]];
        const double o = g.sign[1] * up[g.axis[1]];
        const double s = g.sign[2] * up[g.axis[2]];
        h[kDt][j] = 1.0;
        h[kDi][j] = i;
        h[kDs][j] = s;
        h[kDo][j] = o;
        h[kDii][j] = kappa * i * i;
        h[kDss][j] = kappa * s * s;
        h[kDoo][j] = kappa * o * o;
        h[kDis][j] = kappa * i * s;
        h[kDio][j] = kappa * i * o;
        h[kDos][j] = kappa * s * o;
    }
    return h;
}

Eigen::Vector3d DriftModel::platform_rate(const Pose& pose, const Regressors& h,
                                          const double* parameters) const noexcept {
    Eigen::Vector3d drift = Eigen::Vector3d::Zero();
    for (std::size_t group = 0; group < kGroups; ++group) {
        for (std::size_t j = 0; j < kGyros; ++j) {
            drift[static_cast<Eigen::Index>(j)] +=
                h[group][j] * parameters[internal_index(group, j)];
        }
    }
    return sign_ * drift - pose.earth_rate;
}

Eigen::Matrix3d DriftModel::jacobian(const Pose& pose, double kappa, const double* parameters,
                                     const Eigen::Vector3d& platform_rate) const noexcept {
    // Gradient of each gyro's drift with respect to the specific force direction, platform axes.
    Eigen::Matrix3d gradient = Eigen::Matrix3d::Zero();
    for (std::size_t j = 0; j < kGyros; ++j) {
        const GyroAxes& g = axes_[j];
        const double i = g.sign[0] * pose.up[g.axis[0]];
        const double o = g.sign[1] * pose.up[g.axis[1]];
        const double s = g.sign[2] * pose.up[g.axis[2]];
        const auto d = [&](std::size_t group) { return parameters[internal_index(group, j)]; };
        const double gi = d(kDi) + kappa * (2.0 * d(kDii) * i + d(kDis) * s + d(kDio) * o);
        const double gs = d(kDs) + kappa * (2.0 * d(kDss) * s + d(kDis) * i + d(kDos) * o);
        const double go = d(kDo) + kappa * (2.0 * d(kDoo) * o + d(kDio) * i + d(kDos) * s);
        const auto row = static_cast<Eigen::Index>(j);
        gradient(row, g.axis[0]) += g.sign[0] * gi;
        gradient(row, g.axis[1]) += g.sign[1] * go;
        gradient(row, g.axis[2]) += g.sign[2] * gs;
    }
    Eigen::Matrix3d j;
    for (int k = 0; k < 3; ++k) {
        const Eigen::Vector3d& e = pose.axis[static_cast<std::size_t>(k)];
        const Eigen::Vector3d dw = sign_ * (gradient * e.cross(pose.up)) - e.cross(pose.earth_rate);
        j.col(k) = pose.m * dw;
    }
    // d m / d angle, applied to the rate.
    const double cb = pose.cos_beta, sb = pose.sin_beta, cg = pose.cos_gamma, sg = pose.sin_gamma;
    const double p = cg * platform_rate[0] + sg * platform_rate[1];
    const double r = sg * platform_rate[0] - cg * platform_rate[1];
    j.col(1) += Eigen::Vector3d(-p * sb / (cb * cb), 0.0, -p / (cb * cb));
    j.col(2) += Eigen::Vector3d(r / cb, p, r * sb / cb);
    return j;
}

}  // namespace vibrig::estimator
