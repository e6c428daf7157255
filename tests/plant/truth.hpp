#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "tests/plant/shaker_lies.hpp"
#include "tests/plant/shaker_profile.hpp"
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

enum class GimbalAxis : std::uint8_t { outer, inner, azimuth };

/// What a controller's amplitudes are in: peak g, rms g, peak m/s^2.
enum class AmplitudeUnit : std::uint8_t { g_peak, g_rms, mps2_peak };

/// What the reading of an angle counts in; twice, half: two per deg, one per 2 deg.
enum class AngleUnit : std::uint8_t { deg, turn, rad, arcmin, gon, twice, half };
/// Of these in a deg.
[[nodiscard]] double per_degree(AngleUnit unit) noexcept;

/// Positions within one gyro's ten coefficients; F fixed, I input, O output, S spin (IEEE Std 517).
enum Term : std::size_t { kF, kI, kO, kS, kII, kOO, kSS, kIO, kIS, kOS, kTerms };
inline constexpr std::array<const char*, kTerms> kTermNames{"F",  "I",  "O",  "S",  "II",
                                                            "OO", "SS", "IO", "IS", "OS"};

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
    double time_base = 0;  ///< the rig's clock gains by this share: time stamps are too far apart

    /// Of the base from level: turns about north and about east. The rig's own vertical, along
    /// which it vibrates, leans with it.
    std::array<double, 2> base_tilt_deg{};

    // platform
    Axis up{1, 1};  ///< platform axis that points up at zero gimbal angles
    std::array<std::array<Axis, 3>, 3> gyro_axes{
        {{{{0, 1}, {1, 1}, {2, 1}}},
         {{{1, 1}, {2, 1}, {0, 1}}},
         {{{2, 1}, {0, 1}, {1, 1}}}}};  ///< input, output, spin
    int drift_sign = -1;
    std::array<int, 3> encoder_sign{1, 1, 1};
    Vec3 encoder_zero_deg{0, 0, 0};  ///< angle = sign * (encoder - zero)
    /// Whose angle the channels Outer, Inner, Azimuth show, and who obeys those commands.
    std::array<GimbalAxis, 3> channel{GimbalAxis::outer, GimbalAxis::inner, GimbalAxis::azimuth};
    std::array<GimbalAxis, 3> command_channel = channel;
    /// By gimbal: what its reading counts in. The bus has 0 to 360 of them: then it begins anew.
    std::array<AngleUnit, 3> angle_unit{AngleUnit::deg, AngleUnit::deg, AngleUnit::deg};
    Vec3 command_offset_deg{};                 ///< by gimbal: where it goes over where it was sent
    std::optional<GimbalAxis> stuck_gimbal{};  ///< does not move, and is never in position
    /// By gimbal, either way from angle 0: there it stops, and is not in position; 360: nowhere.
    Vec3 soft_stop_deg{360, 360, 360};
    double slew_deg_per_s = 5;  ///< per gimbal
    double slew_error_deg = 0;  ///< 1 sigma of where a slew ends, per gimbal
    /// Rate of the platform over the rate commanded to the torquers; -1: wired the wrong way round.
    Vec3 torquer_scale{1, 1, 1};
    std::array<int, 3> increment_sign{1, 1, 1};  ///< of the gyros' angle increments
    double sample_rate_hz = 40;                  ///< of all instruments, in whole microseconds
    /// Between outer and inner, inner and azimuth axis at zero angles: a turn about the azimuth
    /// axis before the inner one, one about the outer axis after it.
    std::array<double, 2> non_orthogonality_arcsec{};
    /// The loop lets the platform turn with the vibration, per g of it at the platform: about
    /// platform x, y, z, in phase and a quarter period ahead. Gyros and accelerometers feel it.
    Vec3 platform_rocking_arcsec_g{}, platform_rocking_quadrature_arcsec_g{};
    double warm_up_s = 30;  ///< until the platform reports ready
    double start_temperature_c = 25;
    double steady_temperature_c = 45;
    double thermal_time_constant_s = 20;

    // accelerometer: platform force = matrix * (raw - zero)
    Vec3 zero_g{0, 0, 0};
    Mat3 matrix{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    std::optional<Axis> dead{};  ///< this one (its sign does not matter) shows 0 for ever
    double vibration_gain = 1;   ///< for what vibrates, over that for gravity
    double latency_s = 0;        ///< the force shown is this much older; a sample's period at most

    double accelerometer_bandwidth_hz = 0;  ///< half of the power is seen there; 0: no limit
    int accelerometer_order = 1;            ///< of that low-pass, Butterworth's
    /// x is read now, y half of it and z all of it earlier; with latency_s a sample's period at
    /// most.
    double accelerometer_skew_ms = 0;

    // resolver: amplitudes and phases of errors per turn, outer, inner, azimuth:
    // error = amplitude cos(order * encoder angle + phase)
    Vec3 harmonic_1_arcsec{}, harmonic_1_phase_deg{};
    Vec3 harmonic_2_arcsec{}, harmonic_2_phase_deg{};
    Vec3 harmonic_16_arcsec{}, harmonic_16_phase_deg{};

    // drift: what becomes of the coefficients; gyros x, y, z. Time runs from switching on; a dwell
    // begins when the platform is let go
    Vec3 bias_step_deg_h{};
    Mat3 unbalance_step_deg_h_g{};          ///< rows gyros, columns D_I, D_O, D_S
    std::optional<double> step_at_s{};      ///< none: never
    std::optional<int> step_after_dwell{};  ///< from the next one on
    Vec3 bias_ramp_deg_h_h{};               ///< from zero at switching on
    Mat3 unbalance_ramp_deg_h_g_h{};
    Vec3 bias_ramp_in_dwell_deg_h{};  ///< per 100 s, from zero at the beginning of each dwell
    double bias_walk_deg_h_rt_h = 0;  ///< each gyro by itself, from zero at switching on
    double bias_scatter_deg_h = 0;    ///< 1 sigma, drawn for each dwell
    double bias_markov_deg_h = 0;     ///< 1 sigma, first order
    double bias_markov_s = 300;       ///< its time constant
    Mat3 cubic_deg_h_g3{};            ///< rows gyros, columns I^3, O^3, S^3

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
    /// Horizontal vibration of the platform over the vertical one: north, east; with sign.
    std::array<double, 2> cross_axis{}, cross_axis_quadrature{};  ///< in phase; a quarter ahead
    /// What carries the outer gimbal turns with the vibration, per g at the platform, about north,
    /// up, east. Only the resolvers see it.
    Vec3 base_rocking_arcsec_g{}, base_rocking_quadrature_arcsec_g{};

    bool hard = false;  ///< the platform is bolted to the table: no pads

    // elastic: gyros x, y, z; a part of all their quadratic coefficients is of a mass that yields
    Vec3 elastic_share{};
    Vec3 elastic_resonance_hz{60, 60, 60};
    Vec3 elastic_damping{0.05, 0.05, 0.05};

    // shaker
    std::vector<ShakerProfile> profiles{};  ///< random vibrations that its controller knows
    double second_harmonic = 0;  ///< of the table's acceleration, relative to the fundamental
    double third_harmonic = 0;
    double fourth_harmonic = 0;
    double fifth_harmonic = 0;
    std::array<double, 2> tilt_deg{};     ///< of the vibration from the vertical: to north, east
    double amplitude_drift_per_h = 0;     ///< relative, since the table was last started
    double frequency_drift_hz_per_h = 0;  ///< likewise
    std::string map{};                    ///< file of a foreign register map; empty: Vibrig's own
    double limit_g = 20;                  ///< largest set-point accepted
    double limit_mm = 25;                 ///< peak displacement that trips the limit switch
    ShakerLies shaker_lies;
    // A rig's nature rather than a lie for a while; parse_truth() makes lies of them.
    bool watchdog_works = true;
    AmplitudeUnit amplitude_unit = AmplitudeUnit::g_peak;

    std::uint64_t seed = 1;

    [[nodiscard]] static std::array<GyroCoefficients, 3> table2() noexcept;
};

/// Missing coefficients, unknown keys and impossible values throw PlantError naming file and key.
/// Other sections and keys may be missing: the default holds. A relative `map` is relative to the
/// folder of `file_name`.
[[nodiscard]] Truth parse_truth(std::string_view json, const std::string& file_name);
[[nodiscard]] Truth read_truth(const std::string& path);
[[nodiscard]] std::string to_json(const Truth& truth);
void write_truth(const Truth& truth, const std::string& path);

}  // namespace vibrig::plant
