#include "estimator/filter/kinematics.hpp"

#include <cmath>

#include "estimator/filter/product.hpp"

namespace vibrig::estimator {
double wrap(double angle_rad) noexcept {
    // std::remainder gives the same, slowly: up to one and a half turns the difference is exact.
    if (std::abs(angle_rad) <= kPi) return angle_rad;
    if (std::abs(angle_rad) < 9.4) return angle_rad - std::copysign(2.0 * kPi, angle_rad);
    return std::remainder(angle_rad, 2.0 * kPi);
}

double wrap_next_to(double angle_rad, double reference_rad) noexcept {
    return reference_rad + wrap(angle_rad - reference_rad);
}

Eigen::Matrix3d level_reference(const SignedAxis& up, double elevation_rad) noexcept {
    const int north = (up.axis + 2) % 3, east = (up.axis + 1) % 3;
    // The base leans: the north axis points up by the elevation, the rig's own up axis leans back
    // as much.
    const double cosine = std::cos(elevation_rad), sine = std::sin(elevation_rad);
    Eigen::Matrix3d level = Eigen::Matrix3d::Zero();
    level(north, 0) = cosine;
    level(up.axis, 0) = -up.sign * sine;
    level(north, 1) = sine;
    level(up.axis, 1) = up.sign * cosine;
    level(east, 2) = up.sign;
    return level;
}

Eigen::Vector3d earth_rate_reference(const Eigen::Matrix3d& level, double latitude_rad,
                                     double azimuth_rad) noexcept {
    return kEarthRateDegPerHour *
           (level * Eigen::Vector3d(std::cos(latitude_rad) * std::cos(azimuth_rad),
                                    std::sin(latitude_rad),
                                    -std::cos(latitude_rad) * std::sin(azimuth_rad)));
}

Kinematics::Kinematics(const Settings& settings)
    : level_(level_reference(settings.up, settings.elevation_deg * kRadPerDeg)),
      earth_rate_(estimator::earth_rate_reference(level_, settings.latitude_deg * kRadPerDeg,
                                                  settings.azimuth_deg * kRadPerDeg)),
      encoder_sign_(settings.encoder_sign[0], settings.encoder_sign[1], settings.encoder_sign[2]),
      encoder_zero_(settings.encoder_zero_deg[0], settings.encoder_zero_deg[1],
                    settings.encoder_zero_deg[2]) {
    encoder_zero_ *= kRadPerDeg;
}

Eigen::Vector3d Kinematics::gimbal_angles(const std::array<double, 3>& encoder_rad) const noexcept {
    Eigen::Vector3d angles;
    for (int k = 0; k < 3; ++k) {
        angles[k] =
            wrap(encoder_sign_[k] * (encoder_rad[static_cast<std::size_t>(k)] - encoder_zero_[k]));
    }
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
    pose.level = product(pose.c, level_);
    pose.up = pose.level.col(1);
    pose.earth_rate = pose.c * earth_rate_;
    return pose;
}

}  // namespace vibrig::estimator
