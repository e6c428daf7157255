#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "daemon/interlock/amplitude_witness.hpp"
#include "daemon/interlock/random_bands.hpp"
#include "drivers/sample/sample.hpp"

namespace vibrig::rt {

/// Whether the accelerometers there are agree with a profile at its level: the abort bands of the
/// table and of the platform, along the vertical. The controller's read-back is no witness. Too
/// much is found from the ramp's first sample on, since no ramp goes above its target; too little
/// once the level has been taken for reached. Acquisition thread; add() does not allocate.
class RandomWitness {
  public:
    /// Settings of one profile; see RandomBands::Settings.
    struct Settings {
        double sample_hz = 0;  ///< to be stated
        double table_bandwidth_hz = 0, platform_bandwidth_hz = 0;
        std::array<double, 3> zero_g{};  ///< taken off the raw accelerometers
    };
    /// What holds for a sample.
    struct Situation {
        Ramp ramp;                ///< amplitudes: rms at the table
        bool steady = false;      ///< the campaign has taken the level for reached
        double transmission = 1;  ///< rms at the platform over rms at the table
    };
    struct Verdict {
        AmplitudeWitness::Verdict::Finding off_command;  ///< value: rms at the table
        /// Platform and table, rms at the table; negative: not known.
        std::array<double, 2> seen_g{-1, -1};
    };

    /// Throws std::invalid_argument as RandomBands.
    explicit RandomWitness(const Settings& settings);

    void begin() noexcept;  ///< from rest
    [[nodiscard]] Verdict add(const drivers::Sample& sample, const Situation& situation) noexcept;

    /// 3 dB too much are found within the shortest window, so that a controller's own bands are not
    /// needed beside these.
    [[nodiscard]] bool fast() const noexcept;
    /// Time constant of an exponential mean in which a random vibration of `platform_rms_g` along
    /// the vertical leaves gravity's direction: six of its standard deviations are 0.375 g, so that
    /// a fifth of it across the vertical turns the mean by less than 7 deg. 2 s at least; none
    /// where a minute is not enough.
    [[nodiscard]] std::optional<double> time_for_tilt_s(double platform_rms_g) const noexcept;

  private:
    Settings settings_;
    double independent_hz_;  ///< values in a second, of the platform
    RandomBands platform_, table_;
};

}  // namespace vibrig::rt
