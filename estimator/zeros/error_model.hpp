#pragma once

#include <Eigen/Core>

#include "estimator/zeros/slew_plan.hpp"

namespace vibrig::estimator::zeros {

/// phi E N U, dV E N U, latitude, longitude, height, gyro biases x y z, accelerometer zeros x y z;
/// rad, m/s, rad, m, rad/s, m/s^2. Computed minus true; C_computed = (1 - [phi x]) C.
inline constexpr int kStates = 15;
inline constexpr int kPhi = 0, kVelocity = 3, kPosition = 6, kGyro = 9, kAccelerometer = 12;
using StateMatrix = Eigen::Matrix<double, kStates, kStates>;
using StateVector = Eigen::Matrix<double, kStates, 1>;
using MeasurementMatrix = Eigen::Matrix<double, 6, kStates>;

inline constexpr double kEarthRate = 7.292115e-5;  ///< rad/s

[[nodiscard]] inline Eigen::Matrix3d skew(const Eigen::Vector3d& v) {
    Eigen::Matrix3d m;
    m << 0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0;
    return m;
}
[[nodiscard]] Eigen::Vector3d earth_rate(const Site& site);  ///< east, north, up
/// x' = A x at rest with the body-to-navigation matrix c and specific force f in navigation axes.
[[nodiscard]] StateMatrix error_dynamics(const Eigen::Matrix3d& c, const Eigen::Vector3d& f,
                                         const Site& site);
/// Velocity and position, both in metres.
[[nodiscard]] MeasurementMatrix measurement_matrix(const Site& site);

}  // namespace vibrig::estimator::zeros
