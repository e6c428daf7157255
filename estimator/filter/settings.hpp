#pragma once

#include <array>
#include <cstdint>
#include <stdexcept>
#include <utility>
#include <vector>

#include "estimator/filter/accelerometer_response.hpp"
#include "estimator/filter/coefficients.hpp"
#include "estimator/filter/declared.hpp"

namespace vibrig::estimator {

/// Settings that cannot work; the message names the key ("platform.up"), the value and what was
/// expected.
class SettingsError : public std::invalid_argument {
  public:
    using std::invalid_argument::invalid_argument;
};

/// A signed platform axis, "+x" ... "-z".
struct SignedAxis {
    int axis = 0;  ///< 0 x, 1 y, 2 z
    int sign = 1;
};

enum class Method : std::uint8_t { joint, two_step };

/// Whether the shape is measured, or taken as along the vertical.
enum class SecondMoment : std::uint8_t { measured, vertical };

/// Units are those of the configuration file; names are its keys.
struct Settings {
    // site
    double latitude_deg = 45.75;
    double azimuth_deg = 0.0;
    double elevation_deg = 0.0;  ///< of the rig's north axis: the base is not level
    double gravity_mps2 = 9.80665;
    // vibration
    double frequency_hz = 15.0;
    double transmission = 0.6667;
    double level_window_s = 10.0;
    // platform
    SignedAxis up{1, 1};
    /// [gyro x, y, z][input, output, spin]
    std::array<std::array<SignedAxis, 3>, 3> gyro_axes{
        {{{{0, 1}, {1, 1}, {2, 1}}}, {{{1, 1}, {2, 1}, {0, 1}}}, {{{2, 1}, {0, 1}, {1, 1}}}}};
    int drift_sign = -1;
    SecondMoment second_moment = SecondMoment::measured;
    std::array<int, 3> encoder_sign{1, 1, 1};
    std::array<double, 3> encoder_zero_deg{0, 0, 0};
    // accelerometer
    std::array<double, 3> accelerometer_zero_g{0, 0, 0};
    std::array<std::array<double, 3>, 3> accelerometer_matrix{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    double accelerometer_range_g = 0;  ///< raw readings from here on are saturated; 0: not known
    AccelerometerResponse accelerometer_response;
    /// What they see of random vibrations, by the profile's number in the controller; of one that
    /// is not here all.
    std::vector<std::pair<std::uint16_t, Seen>> seen_profiles;
    // noise
    double resolver_arcsec = 5.0;
    int resolver_bits = 20;
    double gyro_random_walk_deg_per_rt_h = 0.001;
    double accelerometer_g = 1e-4;
    // estimator
    Method method = Method::joint;
    /// Two-step: D_OO is not fixed, as in a run of its own (Tang et al. 2009, trial 3).
    bool all_at_once = false;
    double prior_bias = 10.0;      ///< deg/h, 1 sigma
    double prior_linear = 10.0;    ///< deg/h/g
    double prior_quadratic = 1.0;  ///< deg/h/g^2
    double forgetting = 0.95;
    double gate_nis = 25.0;
    // uncertainty, drift
    uncertainty::Inputs uncertainty;
    uncertainty::Drift drift;
    std::vector<uncertainty::Misfit> free;  ///< structural classes that the data determine as well
};

/// Whether what shakes at `hz` is the vibration at `reference_hz`: within 2 %. At rest, 0, is none
/// but itself.
[[nodiscard]] constexpr bool same_vibration(double hz, double reference_hz) noexcept {
    constexpr double kSame = 0.02;
    return hz == reference_hz ||
           (hz > (1 - kSame) * reference_hz && hz < (1 + kSame) * reference_hz);
}

/// Whether coefficients at Settings::frequency_hz are to take up what shakes at `hz`.
[[nodiscard]] inline bool at_reference(const Settings& settings, double hz) noexcept {
    return same_vibration(hz, settings.frequency_hz);
}

/// Noise as the filter takes it.
struct NoiseLevels {
    double angle_arcsec = 0;  ///< of one encoder reading, quantisation included
    std::array<double, 3> gyro_random_walk_deg_per_rt_h{};
    bool operator==(const NoiseLevels&) const = default;
};
[[nodiscard]] NoiseLevels noise_levels(const Settings& settings) noexcept;

}  // namespace vibrig::estimator
