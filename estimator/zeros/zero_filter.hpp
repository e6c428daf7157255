#pragma once

#include "estimator/zeros/calibration.hpp"
#include "estimator/zeros/strapdown.hpp"

namespace vibrig::estimator::zeros {

/// Besides the 15 states: what each accelerometer shows of the two level axes besides itself. A
/// unit that is not level has some of it in its zeros.
inline constexpr int kCross = kStates, kFilterStates = kStates + 6;
/// 1 sigma of what accelerometer `of` shows of level axis `axis`: its gain or a misalignment. None
/// that is declared is taken for next to none, so that the covariance has an inverse.
[[nodiscard]] double cross_prior(const CalibrationSettings& settings, std::size_t of,
                                 std::size_t axis) noexcept;
using FilterMatrix = Eigen::Matrix<double, kFilterStates, kFilterStates>;
using FilterVector = Eigen::Matrix<double, kFilterStates, 1>;

/// The Kalman filter on the error model around a strapdown mechanisation, in closed loop: after
/// each update the state is taken off attitude, velocity, position and biases.
class ZeroFilter {
  public:
    /// `heading_rad`: of the first level axis now, from east, counter-clockwise about up.
    ZeroFilter(const CalibrationSettings& settings, double heading_rad);

    void advance(const Eigen::Vector3d& turn, const Eigen::Vector3d& velocity, double dt_s);
    /// The vertical gyro has turned so much too far about its own axis, rad, positive about up.
    void turn_back(double azimuth);
    /// Forgets attitude, velocity and position to this extent (1 sigma): rad, m/s, m.
    void loosen(double tilt, double velocity, double position);

    struct Innovation {
        double nis = 0;
        Eigen::Matrix<double, 6, 1> ratio;  ///< square of each row over its expected square
    };
    /// Velocity and position of the azimuth axis are known.
    Innovation update(const Eigen::Vector3d& velocity, const Eigen::Vector3d& position);

    [[nodiscard]] const Eigen::Vector3d& gyro_bias() const noexcept { return gyro_bias_; }
    [[nodiscard]] const Eigen::Vector3d& zero() const noexcept { return zero_; }
    [[nodiscard]] const Eigen::Matrix<double, 3, 2>& cross() const noexcept { return cross_; }
    [[nodiscard]] const FilterMatrix& covariance() const noexcept { return p_; }

  private:
    void propagate();

    const CalibrationSettings settings_;
    Eigen::Vector3d lever_;
    Strapdown strapdown_;
    Eigen::Vector3d gyro_bias_ = Eigen::Vector3d::Zero();  ///< rad/s
    Eigen::Vector3d zero_ = Eigen::Vector3d::Zero();       ///< m/s^2
    Eigen::Vector3d rate_ = Eigen::Vector3d::Zero();       ///< last, rad/s
    FilterMatrix p_, phi_ = FilterMatrix::Identity();
    Eigen::Matrix3d mean_c_ = Eigen::Matrix3d::Zero();
    Eigen::Matrix<double, 3, 2> cross_ = Eigen::Matrix<double, 3, 2>::Zero();
    double part_s_ = 0, since_update_s_ = 0;
    Eigen::Matrix<double, 6, kFilterStates> h_ = Eigen::Matrix<double, 6, kFilterStates>::Zero();
};

}  // namespace vibrig::estimator::zeros
