#pragma once

#include <Eigen/Core>
#include <array>

#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/parameters.hpp"

namespace vibrig::estimator {

/// Regressors of the three gyros, [group][gyro]; flat, this is the filter's parameter order.
using Regressors = std::array<std::array<double, kGyros>, kGroups>;

/// Drift of the three gyros under the averaged vibration (Tang et al. 2009, eqs 8-9 with k1 = 1, k2
/// = kappa). Rates in deg/h, which is arcsec/s.
class DriftModel {
  public:
    explicit DriftModel(const Settings& settings);

    /// `moment`: mean of f f', platform axes, g^2.
    [[nodiscard]] Regressors regressors(const Eigen::Vector3d& up,
                                        const Eigen::Matrix3d& moment) const noexcept;
    /// Regressors of a vibration along the vertical.
    [[nodiscard]] Regressors regressors(const Eigen::Vector3d& up, double kappa) const noexcept {
        return regressors(up, kappa * up * up.transpose());
    }

    /// Rate of the platform relative to the Earth, platform axes: drift_sign * h.D - w_e.
    [[nodiscard]] Eigen::Vector3d platform_rate(const Pose& pose, const Regressors& h,
                                                const double* parameters) const noexcept;

    /// d (angle rates) / d (angles), deg/h per rad; `platform_rate` is that of the same pose.
    [[nodiscard]] Eigen::Matrix3d jacobian(const Pose& pose, const Eigen::Matrix3d& moment,
                                           const double* parameters,
                                           const Eigen::Vector3d& platform_rate) const noexcept;

    [[nodiscard]] double drift_sign() const noexcept { return sign_; }

  private:
    struct GyroAxes {
        std::array<int, 3> axis;  ///< input, output, spin
        std::array<double, 3> sign;
    };
    std::array<GyroAxes, kGyros> axes_;
    double sign_;
};

}  // namespace vibrig::estimator
