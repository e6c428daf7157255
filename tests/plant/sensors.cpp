#include "tests/plant/sensors.hpp"

#include <cmath>
#include <cstdint>
#include <numbers>

namespace vibrig::plant {

double quantise_angle(double deg, int bits) noexcept {
    const std::int64_t count = std::int64_t{1} << bits;
    const auto whole = static_cast<double>(count);
    const auto step = static_cast<std::int64_t>(std::floor(deg / 360 * whole + 0.5)) & (count - 1);
    return static_cast<double>(step) * 360 / whole;
}

Sensors::Sensors(const Truth& truth, std::uint64_t seed)
    : truth_(truth),
      platform_to_raw_(inverse(truth.matrix)),
      resolver_noise_(seed, 1),
      accelerometer_noise_(seed, 2),
      table_noise_(seed, 3) {}

double Sensors::resolver_error_deg(std::size_t axis, double angle_deg) const noexcept {
    struct Harmonic {
        double order;
        const Vec3& arcsec;
        const Vec3& phase_deg;
    };
    double error = 0;
    for (const Harmonic& h :
         {Harmonic{1, truth_.harmonic_1_arcsec, truth_.harmonic_1_phase_deg},
          Harmonic{2, truth_.harmonic_2_arcsec, truth_.harmonic_2_phase_deg},
          Harmonic{16, truth_.harmonic_16_arcsec, truth_.harmonic_16_phase_deg}}) {
        if (h.arcsec[axis] == 0) continue;
        error += h.arcsec[axis] *
                 std::cos((h.order * angle_deg + h.phase_deg[axis]) * (std::numbers::pi / 180));
    }
    return error / 3600;
}

Readings Sensors::read(const Vec3& angles_deg, const Vec3& force_g, double table_g, double time_s) {
    Readings readings;
    const Vec3 raw = platform_to_raw_ * force_g + truth_.zero_g;
    for (std::size_t i = 0; i < 3; ++i) {
        const double noise_deg = truth_.resolver_arcsec / 3600 * resolver_noise_.normal();
        readings.encoder_deg[i] = quantise_angle(
            angles_deg[i] + resolver_error_deg(i, angles_deg[i]) + noise_deg, truth_.resolver_bits);
        readings.raw_g[i] = raw[i] + truth_.accelerometer_g * accelerometer_noise_.normal();
    }
    if (truth_.dead) readings.raw_g[static_cast<std::size_t>(truth_.dead->index)] = 0;
    readings.table_g = table_g + truth_.table_accelerometer_g * table_noise_.normal();
    readings.temperature_c =
        truth_.steady_temperature_c + (truth_.start_temperature_c - truth_.steady_temperature_c) *
                                          std::exp(-time_s / truth_.thermal_time_constant_s);
    return readings;
}

}  // namespace vibrig::plant
