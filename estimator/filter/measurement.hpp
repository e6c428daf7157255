#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>

#include "estimator/filter/accelerometer_response.hpp"

namespace vibrig::estimator {

/// One sample as the estimator takes it: raw encoder angles and raw specific force.
struct Measurement {
    double time_s = 0;                  ///< grows within a dwell
    std::array<double, 3> angle_rad{};  ///< outer, inner, azimuth
    std::array<double, 3> force_g{};    ///< accelerometer axes
    bool angles_good = true;
    bool force_good = true;
};

/// A random vibration as its profile has it at the platform, along the vertical.
struct RandomVibration {
    double mean_square_g2 = 0;  ///< 0: there is none; a sine, or rest
    double bandwidth_hz = 0;    ///< square of the PSD's integral over the integral of its square
    double gain_error = 0;      ///< of the mean square that was played, relative, 1 sigma
    double highest_hz = 0;      ///< up to which there is any power
    std::uint16_t profile = 0;  ///< its number in the controller; 0: not reported
    double level_db = 0;        ///< of what was played about the profile
};

/// A frequency that goes from one end to the other within a dwell, exponentially.
struct SweptSine {
    double from_hz = 0, to_hz = 0;  ///< 0: there is none
    double seconds = 0;             ///< from one to the other

    [[nodiscard]] bool any() const noexcept { return to_hz > 0; }
    [[nodiscard]] bool operator==(const SweptSine&) const = default;
};

/// What became of the question what a controller played in a random dwell.
struct PlayedRandom {
    enum class Word : std::uint8_t { good, not_read, refused };
    Word word = Word::good;
    RandomVibration random{};  ///< as its PSD has it; in place of the profile's where it is good
    Seen seen{};               ///< likewise
    std::uint32_t place = 0;   ///< of the PSD among the campaign's good ones, from 1
};

struct DwellInfo {
    int run = 1;          ///< from 1; the two-step route joins two runs
    int position = 1;     ///< from 1
    double table_g = -1;  ///< commanded peak at the table; negative: not known (a CSV recording)
    /// When its measurements' time is 0, on a clock common to all dwells, s; NaN: there is none.
    double begin_s = std::numeric_limits<double>::quiet_NaN();
    bool power_lost = false;  ///< the gyros were without power since the dwell before
    double frequency_hz = 0;  ///< of the vibration, commanded; 0: Settings::frequency_hz
    bool held_out = false;    ///< to try a result on: the coefficients take nothing of it
    RandomVibration random{};
    /// Of this vibration by the accelerometers; none: as Settings has it of the frequency or the
    /// profile.
    std::optional<Seen> seen{};
    /// In place of a sine at one frequency: no row, and the filter is left alone.
    SweptSine sweep{};
    /// Known after a random dwell alone: for Identification::played(), nothing before it.
    std::optional<PlayedRandom> played{};
};

enum class StepOutcome : std::uint8_t {
    initialised,
    used,
    buffered,
    gated,
    bad_angles,
    bad_force,
    bad_time,
    reinitialised
};

struct StepResult {
    StepOutcome outcome = StepOutcome::used;
    double nis = 0;  ///< three-axis, before the gate
    std::array<double, 3> innovation_arcsec{};
};

}  // namespace vibrig::estimator
