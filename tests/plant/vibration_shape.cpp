#include "tests/plant/vibration_shape.hpp"

#include <cmath>
#include <numbers>

#include "tests/plant/frame.hpp"

namespace vibrig::plant {
namespace {

constexpr double kRadPerDeg = std::numbers::pi / 180;
constexpr double kRadPerArcsec = kRadPerDeg / 3600;

bool any(const std::array<Vec3, 2>& rocking) {
    return dot(rocking[0], rocking[0]) + dot(rocking[1], rocking[1]) > 0;
}

}  // namespace

VibrationShape::VibrationShape(const Truth& truth) noexcept {
    const Frame frame(truth);
    const Vec3 tilted = frame.up + std::tan(truth.tilt_deg[0] * kRadPerDeg) * frame.north +
                        std::tan(truth.tilt_deg[1] * kRadPerDeg) * frame.east;
    straight_ = (1 / std::sqrt(dot(tilted, tilted))) * tilted;
    across_ = truth.cross_axis[0] * frame.north + truth.cross_axis[1] * frame.east;
    across_quadrature_ =
        truth.cross_axis_quadrature[0] * frame.north + truth.cross_axis_quadrature[1] * frame.east;
    platform_rocking_ = {kRadPerArcsec * truth.platform_rocking_arcsec_g,
                         kRadPerArcsec * truth.platform_rocking_quadrature_arcsec_g};
    const auto base = [&](const Vec3& arcsec_g) {
        return kRadPerArcsec *
               (arcsec_g[0] * frame.north + arcsec_g[1] * frame.up + arcsec_g[2] * frame.east);
    };
    base_rocking_ = {base(truth.base_rocking_arcsec_g),
                     base(truth.base_rocking_quadrature_arcsec_g)};
    grow(1, 1);
    platform_rocks_ = any(platform_rocking_);
    base_rocks_ = any(base_rocking_);
}

}  // namespace vibrig::plant
