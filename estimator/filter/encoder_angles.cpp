#include "estimator/filter/encoder_angles.hpp"

#include <cmath>
#include <cstddef>

namespace vibrig::estimator {

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

std::array<double, 3> azimuth_upright_deg(const Settings& settings, double azimuth_deg, bool down) {
    // The outer gimbal turns about x: it takes y to z, never x.
    if (settings.up.axis == 0) {
        throw SettingsError(
            "platform.up: x, expected y or z for zeroing: the azimuth axis cannot be vertical "
            "without the inner gimbal beyond 80 deg");
    }
    double outer = settings.up.axis == 1 ? 90 * settings.up.sign : 90 - 90 * settings.up.sign;
    if (down) outer += 180;
    // Where the base leans along the north axis: x with up along y, y with up along z.
    double inner = 0;
    if (settings.up.axis == 1) {
        inner = down ? settings.elevation_deg : -settings.elevation_deg;
    } else {
        outer += settings.up.sign * settings.elevation_deg;
    }
    std::array<double, 3> encoder = encoder_deg(settings, {outer, inner, azimuth_deg});
    for (double& angle : encoder) angle = std::remainder(angle, 360.0);
    return encoder;
}

std::array<double, 3> inner_upright_deg(const Settings& settings, double inner_deg, bool down) {
    // A quarter of a turn of the outer gimbal takes z up to y up.
    const auto z_up = gimbal_deg(settings, azimuth_upright_deg(settings, 0, false));
    std::array<double, 3> encoder =
        encoder_deg(settings, {z_up[0] - 90, inner_deg, down ? 180.0 : 0.0});
    for (double& angle : encoder) angle = std::remainder(angle, 360.0);
    return encoder;
}

}  // namespace vibrig::estimator
