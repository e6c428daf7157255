#pragma once

#include <array>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>

#include "tests/plant/shaker_lies.hpp"
#include "tests/plant/vec3.hpp"

namespace vibrig::plant {

/// Bad input to the simulated rig: names the place, what was found and what was expected.
class PlantError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// A platform axis with a direction, written "+x" or "-z".
struct Axis {
    int index = 0;
    int sign = 1;
};

/// Positions within one gyro's ten coefficients; F fixed, I input, O output, S spin (IEEE Std 517).
enum Term : std::size_t { kF, kI, kO, kS, kII, kOO, kSS, kIO, kIS, kOS, kTerms };

using GyroCoefficients = std::array<double, kTerms>;  ///< deg/h, deg/h/g x 3, deg/h/g^2 x 6

/// "D_Fx" ... "D_OSz"; gyro 0, 1, 2 is x, y, z.
[[nodiscard]] std::string coefficient_name(std::size_t gyro, std::size_t term);
[[nodiscard]] std::string_view coefficient_unit(std::size_t term) noexcept;

/// Everything the simulated rig is made of. The defaults are Table 2 of Tang et al. 2009 on an
/// otherwise ideal rig. Keys that the configuration of the daemon has too mean the same here.
struct Truth {
    std::array<GyroCoefficients, 3> coefficients = table2();

    // site
    double latitude_deg = 45.75;
    double azimuth_deg = 0;  ///< of the rig's north axis, from true north towards east
    double gravity_mps2 = 9.80665;

    // platform
    Axis up{1, 1};  ///< platform axis that points up at zero gimbal angles
    std::array<std::array<Axis, 3>, 3> gyro_axes{
        {{{{0, 1}, {1, 1}, {2, 1}}},
         {{{1, 1}, {2, 1}, {0, 1}}},
         {{{2, 1}, {0, 1}, {1, 1}}}}};  ///< input, output, spin
    int drift_sign = -1;
    std::array<int, 3> encoder_sign{1, 1, 1};
    Vec3 encoder_zero_deg{0, 0, 0};  ///< angle = sign * (encoder - zero)
    double slew_deg_per_s = 5;       ///< per gimbal
    double slew_error_deg = 0;       ///< 1 sigma of where a slew ends, per gimbal
    /// Rate of the platform over the rate commanded to the torquers; -1: wired the wrong way round.
    Vec3 torquer_scale{1, 1, 1};
    std::array<int, 3> increment_sign{1, 1, 1};  ///< of the gyros' angle increments
    double sample_rate_hz = 40;                  ///< of all instruments, in whole microseconds
    double warm_up_s = 30;                       ///< until the platform reports ready
    double start_temperature_c = 25;
    double steady_temperature_c = 45;
    double thermal_time_constant_s = 20;

    // accelerometer: platform force = matrix * (raw - zero)
    Vec3 zero_g{0, 0, 0};
    Mat3 matrix{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};

    // noise, 1 sigma per sample
    double resolver_arcsec = 5;
    int resolver_bits = 20;
    double gyro_random_walk_deg_per_rt_h = 0.001;
    double accelerometer_g = 1e-4;
    double table_accelerometer_g = 1e-3;

    // isolator
    double transmission = 2.0 / 3.0;  ///< platform over table at frequency_hz
    double frequency_hz = 15;
    double damping = 0.2;       ///< fraction of critical
    double slew_kick_g = 0.02;  ///< the platform rocks on its mounts by this much when a slew ends

    // shaker
    double second_harmonic = 0;  ///< of the table's acceleration, relative to the fundamental
    double limit_g = 20;         ///< largest set-point accepted
    double limit_mm = 25;        ///< peak displacement that trips the limit switch
    ShakerLies shaker_lies;

    std::uint64_t seed = 1;

    [[nodiscard]] static std::array<GyroCoefficients, 3> table2() noexcept;
};

/// Missing coefficients, unknown keys and impossible values throw PlantError naming file and key.
/// Other sections and keys may be missing: the default holds.
[[nodiscard]] Truth parse_truth(std::string_view json, const std::string& file_name);
[[nodiscard]] Truth read_truth(const std::string& path);
[[nodiscard]] std::string to_json(const Truth& truth);
void write_truth(const Truth& truth, const std::string& path);

}  // namespace vibrig::plant
