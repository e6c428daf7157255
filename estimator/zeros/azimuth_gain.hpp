#pragma once

#include <Eigen/Core>

namespace vibrig::estimator::zeros {

/// Gain error of the vertical gyro from the azimuth read-out: the turn that it has summed up is
/// (1 + gain) times the one read, plus bias, plus a part in proportion to the rate, by which a
/// read-out is late. Least squares with weak priors; to and fro tells them apart.
class AzimuthGain {
  public:
    explicit AzimuthGain(double bias_sigma);  ///< rad/s

    struct Point {
        double time_s = 0;   ///< since the first one
        double turned = 0;   ///< by the gyro, rad
        double azimuth = 0;  ///< read, rad, of any turn
        double rate = 0;     ///< rad/s
    };
    void add(const Point& point);
    /// The gyro may have missed so much, rad (1 sigma).
    void loosen(double turn);

    [[nodiscard]] double value() const noexcept { return value_; }
    /// Read-out since the first point, over all turns.
    [[nodiscard]] double read_rad() const noexcept { return read_; }

  private:
    Eigen::Matrix4d normal_;  ///< gain, start, bias, lateness
    Eigen::Vector4d right_ = Eigen::Vector4d::Zero();
    bool begun_ = false;
    double last_ = 0, read_ = 0, value_ = 0;
};

}  // namespace vibrig::estimator::zeros
