#include "estimator/filter/kinematics.hpp"

#include <cmath>

namespace vibrig::estimator {
namespace {
constexpr double kRadPerDeg = kPi / 180.0;
}

double wrap(double angle_rad) noexcept {
    // std::remainder gives the same, slowly.
    return std::abs(angle_rad) <= kPi ? angle_rad : std::remainder(angle_rad, 2.0 * kPi);
}

double wrap_next_to(double angle_rad, double reference_rad) noexcept {
    return reference_rad + wrap(angle_rad - reference_rad);
}

Kinematics::Kinematics(const Settings& settings)
    : up_(Eigen::Vector3d::Zero()),
      earth_rate_(Eigen::Vector3d::Zero()),
      encoder_sign_(settings.encoder_sign[0], settings.encoder_sign[1], settings.encoder_sign[2]),
      encoder_zero_(settings.encoder_zero_deg[0], settings.encoder_zero_deg[1],
                    settings.encoder_zero_deg[2]) {
    encoder_zero_ *= kRadPerDeg;
    // North is the axis before `up`, east the axis after it; a minus sign turns up and east round.
    const int up = settings.up.axis;
    const int north = (up + 2) % 3;
    const int east = (up + 1) % 3;
    const double latitude = settings.latitude_deg * kRadPerDeg;
    const double azimuth = settings.azimuth_deg * kRadPerDeg;
    up_[up] = settings.up.sign;
    earth_rate_[north] = std::cos(latitude) * std::cos(azimuth);
    earth_rate_[up] = settings.up.sign * std::sin(latitude);
    earth_rate_[east] = -settings.up.sign * std::cos(latitude) * std::sin(azimuth);
    earth_rate_ *= kEarthRateDegPerHour;
}

Eigen::Vector3d Kinematics::gimbal_angles(const std::array<double, 3>& encoder_rad) const noexcept {
    Eigen::Vector3d angles;
    for (int k = 0; k < 3; ++k) {
        angles[k] =
            wrap(encoder_sign_[k] * (encoder_rad[static_cast<std::size_t>(k)] - encoder_zero_[k]));
    }
    return angles;
}

std::array<double, 3> gimbal_deg(const Settings& settings,
                                 const std::array<double, 3>& encoder_deg) noexcept {
    std::array<double, 3> angles{};
    for (std::size_t k = 0; k < 3; ++k)
        angles[k] = settings.encoder_sign[k] * (encoder_deg[k] - settings.encoder_zero_deg[k]);
    return angles;
}

std::array<double, 3> encoder_deg(const Settings& settings,
                                  const std::array<double, 3>& gimbal_deg) noexcept {
    std::array<double, 3> angles{};
    for (std::size_t k = 0; k < 3; ++k)
        angles[k] = settings.encoder_sign[k] * gimbal_deg[k] + settings.encoder_zero_deg[k];
    return angles;
}

Pose Kinematics::pose(const Eigen::Vector3d& angles_rad) const noexcept {
    const double ca = std::cos(angles_rad[0]), sa = std::sin(angles_rad[0]);
    const double cb = std::cos(angles_rad[1]), sb = std::sin(angles_rad[1]);
    const double cg = std::cos(angles_rad[2]), sg = std::sin(angles_rad[2]);
    Pose pose;
    pose.cos_beta = cb;
    pose.sin_beta = sb;
    pose.cos_gamma = cg;
    pose.sin_gamma = sg;
    // Rz(g)^T Ry(b)^T Rx(a)^T, multiplied out.
    pose.c << cg * cb, cg * sb * sa - sg * ca, cg * sb * ca + sg * sa,  //
        sg * cb, sg * sb * sa + cg * ca, sg * sb * ca - cg * sa,        //
        -sb, cb * sa, cb * ca;
    pose.m << -cg / cb, -sg / cb, 0.0,  //
        sg, -cg, 0.0,                   //
        -cg * sb / cb, -sg * sb / cb, -1.0;
    pose.axis[0] = {cg * cb, sg * cb, -sb};
    pose.axis[1] = {-sg, cg, 0.0};
    pose.axis[2] = {0.0, 0.0, 1.0};
    pose.up = pose.c * up_;
    pose.earth_rate = pose.c * earth_rate_;
    return pose;
}

}  // namespace vibrig::estimator
