#pragma once

#include <array>
#include <cstdint>

#include "daemon/interlock/lock_in.hpp"
#include "drivers/sample/sample.hpp"

namespace vibrig::rt {

/// A frequency that goes from one end to the other, exponentially, and stays there.
struct Sweep {
    static constexpr std::size_t kAlong = 9;
    using Along = std::array<double, kAlong>;

    double from_hz = 0, to_hz = 0;  ///< 0: there is none
    double octaves_per_s = 0;       ///< towards to_hz; 0: it has not begun
    drivers::Time begin = 0;
    Along transmission{};  ///< platform over table at equal steps of the logarithm; 0: not known

    [[nodiscard]] bool any() const noexcept { return to_hz > 0; }
    [[nodiscard]] double hz(drivers::Time at) const noexcept;
    /// Turns since `begin`, negative before.
    [[nodiscard]] double turns(drivers::Time at) const noexcept;
    [[nodiscard]] double transmission_at(drivers::Time at) const noexcept;
};

/// What was commanded; amplitudes are peak at the table.
struct Ramp {
    double start_g = 0, target_g = 0;
    drivers::Time begin = 0;  ///< when it was asked for; the controller begins at its last write
    drivers::Time duration = 0;
    double armed_g = 0;  ///< highest level of the arming; 0: none
    /// False while the loop check measures it: then the platform tells within a factor of 2.
    bool transmission_known = true;
    /// What the raw accelerometers show of 1 g along the vertical at this position; all 0: unknown.
    std::array<double, 3> raw_up{};
    double frequency_hz = 0;  ///< 0: the configuration's
    double transmission = 0;  ///< platform over table there; 0: as configured or measured
    /// Random vibration: its place in Interlock::Limits::random, from 1; amplitudes are rms then,
    /// and so is the transmission. 0: a sine.
    std::uint16_t random = 0;

    Sweep sweep{};  ///< in place of a frequency

    std::uint64_t number = 0;  ///< the interlock's

    [[nodiscard]] double at(drivers::Time time, drivers::Time from) const noexcept;
};

/// Whether every accelerometer there is agrees with the command: the platform's over the
/// transmission, and the table's. Amplitudes are of the fundamental, by lock-in over 0.3 s, longer
/// only where the samples' alias is so near to zero or half the rate that less does not tell. The
/// controller's own read-back is no witness. Acquisition thread; no allocation.
class AmplitudeWitness {
  public:
    struct Settings {
        double frequency_hz = 15;
        drivers::Time sample_period = 0;  ///< to be stated
        std::array<double, 3> zero_g{};
        std::array<std::array<double, 3>, 3> matrix{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
        /// Resolution of accelerometers x, y, z and the table's, g; 0: not known.
        std::array<double, 4> count_g{};
    };
    /// One judgement; channel: Channel::accel_x stands for the platform's accelerometers.
    struct Verdict {
        struct Finding {
            bool wrong = false;
            drivers::Channel channel = drivers::Channel::accel_x;
            double value_g = 0;  ///< at the table; negative: not known, for too long
        };
        Finding off_command, over_armed, over_limit;
        Finding stuck;                         ///< value: the vibration expected of it, g
        std::array<double, 2> seen_g{-1, -1};  ///< platform, table; at the table; negative: unknown
        /// Platform, table: whatever is wrong of it now, for however short a time.
        std::array<bool, 2> contradicts{};
    };
    /// What holds at the moment of a judgement.
    struct Situation {
        Ramp ramp;
        drivers::Time controller_began = 0;  ///< with the ramp; 0: not yet
        drivers::Time now = 0;               ///< sample time or later, where samples come late
        bool steady = false;                 ///< the campaign has taken the level for reached
        double transmission = 1, limit_g = 0;
    };

    static constexpr double kDecibel = 1.1220184543019633;  ///< 1 dB
    static constexpr double kFromG = 0.3;                   ///< ramps are judged from here on
    static constexpr double kToleranceG = 0.02;
    static constexpr drivers::Time kCommandWindow = 500 * drivers::kMillisecond;

    /// Throws std::invalid_argument without a sample period.
    explicit AmplitudeWitness(const Settings& settings);
    void begin() noexcept;  ///< excitation begins
    /// What it is to be at; from rest, as if excitation began.
    void retune(double frequency_hz) noexcept;
    /// Likewise, from where it is now on; what was seen so far stays.
    void follow(const Sweep& sweep) noexcept;
    /// A sweep is where the samples' alias is too near to zero or half the rate to tell an
    /// amplitude from a phase within the window.
    [[nodiscard]] bool blind() const noexcept;
    /// True: a block is complete, and verdict() judges the newest.
    [[nodiscard]] bool add(const drivers::Sample& sample) noexcept;
    [[nodiscard]] Verdict verdict(const Situation& situation) noexcept;
    /// Whether an accelerometer does not move that should, or has too few readings to be seen; all
    /// that is judged of random vibration, whose peaks are beyond its rms.
    [[nodiscard]] Verdict verdict_at_random(const Situation& situation) noexcept;
    [[nodiscard]] double window_s() const noexcept { return drivers::to_seconds(window_); }

  private:
    struct Bounds {
        double low = 0, high = 0;
    };
    [[nodiscard]] Bounds bounds(const Situation& now, bool known, double low, double high) const;
    void set_windows() noexcept;
    /// Whose amplitude has not been known for too long, of those that there are.
    void look_for_unknown(const Situation& now, const std::array<bool, 2>& shown,
                          Verdict& verdict) noexcept;
    [[nodiscard]] double platform_g() const noexcept;
    [[nodiscard]] double table_g() const noexcept;
    /// Platform, table: true for one that does not move where another does; it will be named as
    /// stuck.
    [[nodiscard]] std::array<bool, 2> look_for_stuck(const Situation& now, double command_g,
                                                     Verdict& verdict) const noexcept;
    /// Largest less smallest reading in the newest blocks, g; infinite: too few.
    [[nodiscard]] double range(std::size_t channel, std::size_t blocks) const noexcept;

    Settings settings_;
    Sweep sweep_;
    drivers::Time window_ = 0, block_ = 0;
    double fewest_ = 0;  ///< samples in a window
    LockIn<3> force_;
    LockIn<1> table_;
    drivers::Time origin_ = 0, newest_ = 0;
    std::int64_t block_number_ = 0;
    drivers::Time steady_since_ = 0;
    drivers::Time judged_at_ = 0;           ///< newest sample of the judgement before
    std::array<bool, 2> bound_{};           ///< platform, table: there is one
    std::array<drivers::Time, 2> known_{};  ///< when its amplitude was known last
    std::array<drivers::Time, 2> off_since_{}, over_since_{}, limit_since_{};  ///< platform, table
};

}  // namespace vibrig::rt
