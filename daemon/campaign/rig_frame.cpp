#include "daemon/campaign/rig_frame.hpp"

#include <cmath>

#include "estimator/filter/angles.hpp"
#include "estimator/filter/encoder_angles.hpp"
#include "estimator/filter/kinematics.hpp"

namespace vibrig::campaign {
namespace {

using estimator::kRadPerDeg;

}  // namespace

RigFrame::RigFrame(const estimator::Settings& settings) : settings_(settings) {
    const Matrix& m = settings.accelerometer_matrix;
    const Vector c0 = cross(m[1], m[2]), c1 = cross(m[2], m[0]), c2 = cross(m[0], m[1]);
    const double k = 1 / dot(m[0], c0);
    for (std::size_t i = 0; i < 3; ++i) inverse_[i] = {k * c0[i], k * c1[i], k * c2[i]};
}

Vector RigFrame::up(const Vector& encoder_rad) const {
    const estimator::Kinematics kinematics(settings_);
    const auto pose = kinematics.pose(kinematics.gimbal_angles(encoder_rad));
    return {pose.up[0], pose.up[1], pose.up[2]};
}

Vector RigFrame::up_at_deg(const Vector& encoder_deg) const {
    return up(
        {kRadPerDeg * encoder_deg[0], kRadPerDeg * encoder_deg[1], kRadPerDeg * encoder_deg[2]});
}

std::array<Vector, 2> RigFrame::north_east_at_deg(const Vector& encoder_deg) const {
    const estimator::Kinematics kinematics(settings_);
    const auto pose = kinematics.pose(kinematics.gimbal_angles(
        {kRadPerDeg * encoder_deg[0], kRadPerDeg * encoder_deg[1], kRadPerDeg * encoder_deg[2]}));
    std::array<Vector, 2> axes{};
    for (std::size_t i = 0; i < 3; ++i) {
        axes[0][i] = pose.level(static_cast<Eigen::Index>(i), 0);
        axes[1][i] = pose.level(static_cast<Eigen::Index>(i), 2);
    }
    return axes;
}

double RigFrame::azimuth(const Vector& encoder_rad, int upright) const {
    const estimator::Kinematics kinematics(settings_);
    const auto pose = kinematics.pose(kinematics.gimbal_angles(encoder_rad));
    // North is the axis before `up`, east the one after it; turning `up` over turns east over too.
    const int axis = settings_.up.axis, row = (upright + 1) % 3;
    const double elevation = kRadPerDeg * settings_.elevation_deg;
    const double north = std::cos(elevation) * pose.c(row, (axis + 2) % 3) -
                         std::sin(elevation) * settings_.up.sign * pose.c(row, axis);
    const double east = settings_.up.sign * pose.c(row, (axis + 1) % 3);
    const double from_north = std::atan2(east, north) + kRadPerDeg * settings_.azimuth_deg;
    return std::remainder(0.5 * estimator::kPi - from_north, 2 * estimator::kPi);
}

Vector RigFrame::azimuth_vertical_deg(double azimuth_deg, bool down) const {
    return estimator::azimuth_upright_deg(settings_, azimuth_deg, down);
}

Vector RigFrame::inner_vertical_deg(double inner_deg, bool down) const {
    return estimator::inner_upright_deg(settings_, inner_deg, down);
}

Vector RigFrame::force(const Vector& raw, double one) const {
    Vector off{};
    for (std::size_t i = 0; i < 3; ++i) off[i] = raw[i] - one * settings_.accelerometer_zero_g[i];
    const Matrix& m = settings_.accelerometer_matrix;
    return {dot(m[0], off), dot(m[1], off), dot(m[2], off)};
}

Vector RigFrame::to_raw(const Vector& platform) const {
    return {dot(inverse_[0], platform), dot(inverse_[1], platform), dot(inverse_[2], platform)};
}

}  // namespace vibrig::campaign
