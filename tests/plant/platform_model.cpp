#include "tests/plant/platform_model.hpp"

#include <cmath>
#include <numbers>

namespace vibrig::plant {
namespace {

constexpr double kRadPerDeg = std::numbers::pi / 180;
constexpr double kRadPerSecondOfDegPerHour = kRadPerDeg / 3600;
constexpr double kEarthRate = 15.041067;  ///< deg/h

double along(const Vec3& v, const Axis& axis) noexcept {
    return axis.sign * v[static_cast<std::size_t>(axis.index)];
}

}  // namespace

PlatformModel::PlatformModel(const Truth& truth)
    : coefficients_(truth.coefficients),
      gyro_axes_(truth.gyro_axes),
      drift_sign_(truth.drift_sign) {
    // North is the axis before `up`, east the axis after it; turning `up` over turns east over too.
    const auto axis = static_cast<std::size_t>(truth.up.index);
    const double sign = truth.up.sign;
    Vec3 north{};
    Vec3 east{};
    up_[axis] = sign;
    north[(axis + 2) % 3] = 1;
    east[(axis + 1) % 3] = sign;
    const double latitude = truth.latitude_deg * kRadPerDeg;
    const double azimuth = truth.azimuth_deg * kRadPerDeg;
    earth_ =
        kEarthRate * (std::cos(latitude) * (std::cos(azimuth) * north - std::sin(azimuth) * east) +
                      std::sin(latitude) * up_);
}

Vec3 PlatformModel::to_platform(const Vec3& angles, const Vec3& reference) noexcept {
    // The reference vector as seen after each gimbal in turn: outer about x, inner about y, azimuth
    // about z.
    const double ca = std::cos(angles[0]), sa = std::sin(angles[0]);
    const double cb = std::cos(angles[1]), sb = std::sin(angles[1]);
    const double cg = std::cos(angles[2]), sg = std::sin(angles[2]);
    const Vec3 outer{reference[0], ca * reference[1] - sa * reference[2],
                     sa * reference[1] + ca * reference[2]};
    const Vec3 inner{cb * outer[0] + sb * outer[2], outer[1], cb * outer[2] - sb * outer[0]};
    return {cg * inner[0] - sg * inner[1], sg * inner[0] + cg * inner[1], inner[2]};
}

Vec3 PlatformModel::gyro_drift(const Vec3& up_platform, double a1) const noexcept {
    // Every gyro feels the specific force (1 + A1) u; nothing is averaged.
    const double level = 1 + a1;
    Vec3 drift{};
    for (std::size_t gyro = 0; gyro < 3; ++gyro) {
        const GyroCoefficients& d = coefficients_[gyro];
        const double i = level * along(up_platform, gyro_axes_[gyro][0]);
        const double o = level * along(up_platform, gyro_axes_[gyro][1]);
        const double s = level * along(up_platform, gyro_axes_[gyro][2]);
        drift[gyro] = d[kF] + i * (d[kI] + d[kII] * i + d[kIO] * o + d[kIS] * s) +
                      o * (d[kO] + d[kOO] * o + d[kOS] * s) + s * (d[kS] + d[kSS] * s);
    }
    return drift;
}

Vec3 PlatformModel::angle_rates(const Vec3& angles, double a1, const Vec3& extra) const noexcept {
    const double ca = std::cos(angles[0]), sa = std::sin(angles[0]);
    const double cb = std::cos(angles[1]), sb = std::sin(angles[1]);
    const double cg = std::cos(angles[2]), sg = std::sin(angles[2]);
    const auto seen = [&](const Vec3& r) -> Vec3 {
        const double y = ca * r[1] - sa * r[2];
        const double z = sa * r[1] + ca * r[2];
        const double x = cb * r[0] + sb * z;
        return {cg * x - sg * y, sg * x + cg * y, cb * z - sb * r[0]};
    };
    // The loop holds the gyro outputs at zero, so the platform turns against its drift in inertial
    // space; relative to the Earth the Earth's own rate comes off.
    const Vec3 rate = drift_sign_ * gyro_drift(seen(up_), a1) + extra - seen(earth_);
    // The gimbals turn base against platform: rate = -(alpha' outer + beta' inner + gamma' azimuth
    // axis). In platform axes the inner axis is level at (-sg, cg, 0), the outer axis leans by beta
    // out of the level plane, (cg cb, sg cb, -sb), and the azimuth axis is z. So the part of the
    // rate along (cg, sg, 0) is due to the outer gimbal alone, and what it leaves on z is made up
    // by the azimuth gimbal.
    const double alpha = -(cg * rate[0] + sg * rate[1]) / cb;
    const double beta = sg * rate[0] - cg * rate[1];
    const double gamma = alpha * sb - rate[2];
    return kRadPerSecondOfDegPerHour * Vec3{alpha, beta, gamma};
}

void PlatformModel::advance(double step_s, std::span<const double> a1, const Vec3& extra) noexcept {
    for (std::size_t i = 0; i + 2 < a1.size(); i += 2) {
        const Vec3 k1 = angle_rates(angles_, a1[i], extra);
        const Vec3 k2 = angle_rates(angles_ + (step_s / 2) * k1, a1[i + 1], extra);
        const Vec3 k3 = angle_rates(angles_ + (step_s / 2) * k2, a1[i + 1], extra);
        const Vec3 k4 = angle_rates(angles_ + step_s * k3, a1[i + 2], extra);
        angles_ = angles_ + (step_s / 6) * (k1 + 2 * k2 + 2 * k3 + k4);
    }
}

}  // namespace vibrig::plant
