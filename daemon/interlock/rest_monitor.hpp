#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "drivers/base/snapshot.hpp"
#include "drivers/sample/sample.hpp"
#include "proto/safety.hpp"

namespace vibrig::rt {

/// When a body counts as at rest.
struct RestSettings {
    /// rms below; at least 6 sigma of the accelerometers' noise
    double limit_g = safety::kRest_g;
    double window_s =
        safety::kRestWindow_s;  ///< of the rms; 8 samples at least, where they come slower
};

enum class RestVerdict : std::uint8_t {
    absent,   ///< there is no such accelerometer
    unknown,  ///< stale, invalid, or not yet a window of good values: nobody may call it rest
    moving,
    still,
};

/// What one accelerometer shows.
struct RestWitness {
    RestVerdict verdict = RestVerdict::unknown;
    double rms_g = 0;        ///< over the window; 0 while unknown
    drivers::Time from = 0;  ///< first and last sample of the window
    drivers::Time to = 0;
    /// Unknown because it has not been seen to move since it was doubted, or has lost the noise
    /// that it had at rest.
    bool doubted = false;
    /// g; empty while unknown.
    [[nodiscard]] std::optional<double> rms() const noexcept {
        if (verdict != RestVerdict::moving && verdict != RestVerdict::still) return {};
        return rms_g;
    }
};

/// What all accelerometers show at one moment.
struct Rest {
    RestWitness platform, table;
    [[nodiscard]] bool measured() const noexcept { return measured_since(0); }
    /// Measured, and by nothing that was before `moment`. One that is doubted is no witness: the
    /// other alone decides, and where there is none nobody does.
    [[nodiscard]] bool measured_since(drivers::Time moment) const noexcept {
        const auto still = [moment](const RestWitness& witness) {
            return witness.verdict == RestVerdict::still && witness.from >= moment;
        };
        if (platform.doubted) return still(table);
        return still(platform) &&
               (still(table) || table.doubted || table.verdict == RestVerdict::absent);
    }
    [[nodiscard]] bool moving() const noexcept {
        return platform.verdict == RestVerdict::moving || table.verdict == RestVerdict::moving;
    }
};

/// The last good values of one quantity: a sliding window in fixed memory.
class RestWindow {
  public:
    RestWindow(drivers::Time window, drivers::Time sample_period);
    /// g. What is not later than the newest is left out.
    void add(drivers::Time time, double value) noexcept;
    [[nodiscard]] RestWitness judge(double limit_g) const noexcept;
    void clear() noexcept { count_ = 0; }

  private:
    struct Entry {
        drivers::Time time = 0;
        double value = 0;
    };
    [[nodiscard]] const Entry& at(std::size_t i) const noexcept {
        const std::size_t there = first_ + i;  // a division for each would be half of the sum
        return ring_[there < ring_.size() ? there : there - ring_.size()];
    }
    drivers::Time window_, sample_period_;
    std::vector<Entry> ring_;
    std::size_t first_ = 0, count_ = 0;
};

/// Whether readings that are doubted move by more than two counts within a window. The noise of one
/// that works is enough for that, where it has more than half a count.
class Doubt {
  public:
    explicit Doubt(drivers::Time window) : window_(window) {}
    void begin() noexcept { open_ = true, from_ = 0; }
    [[nodiscard]] bool open() const noexcept { return open_; }
    /// True: that has ended it, all of them have moved.
    bool settled_by(drivers::Time time, std::span<const double> values,
                    std::span<const double> counts_g) noexcept;

  private:
    static constexpr std::size_t kMost = 3;
    drivers::Time window_, from_ = 0;
    std::array<double, kMost> low_{}, high_{};
    bool open_ = false;
};

/// Whether readings still show the noise that they had at rest: what shows its last value for ever
/// is as still as nothing else is. Of readings whose noise was never clearly beyond two counts that
/// cannot be told.
class Liveness {
  public:
    Liveness(drivers::Time window, drivers::Time sample_period)
        : window_(window), silent_for_(window - 2 * sample_period) {}
    void add(drivers::Time time, std::span<const double> values,
             std::span<const double> counts_g) noexcept;
    /// Whether the window up to the newest reading is one of rest, lost or not.
    void judged(bool still, std::span<const double> counts_g) noexcept;
    /// One that lived has stayed within two counts for a window.
    [[nodiscard]] bool lost() const noexcept;

  private:
    struct Axis {
        double low = 0, high = 0;  ///< since it went beyond two counts last
        drivers::Time since = 0;
        double rest_low = 0, rest_high = 0;  ///< of the window of rest at work
        double middle = 0;                   ///< of the one before
        int windows = 0;                     ///< of rest in a row with its noise
        bool lived = false;
    };
    void begin_window() noexcept;

    drivers::Time window_, silent_for_;
    drivers::Time newest_ = 0, rest_from_ = 0;
    std::array<double, 3> newest_value_{};
    std::array<Axis, 3> axes_{};
};

/// Rest as a measurement: the rms of the norm of the specific force less its mean, and of the table
/// accelerometer where there is one. The norm, not the axes: a slow tilt is no vibration.
class RestMonitor {
  public:
    /// Resolution of accelerometers x, y, z and the table's, g; 0: not known.
    using Counts = std::array<double, 4>;
    RestMonitor(const RestSettings& settings, drivers::Time sample_period,
                const Counts& counts_g = {});

    /// Acquisition thread; neither allocates, locks nor logs.
    void add(const drivers::Sample& sample) noexcept;
    /// Acquisition thread, or before it starts: an accelerometer has contradicted what was
    /// commanded. Its body's stillness is no rest until it is seen to move, or to be noisy.
    void doubt(drivers::Channel channel) noexcept;
    /// Any thread. What is too old by `now` is unknown.
    [[nodiscard]] Rest rest(drivers::Time now) const noexcept;

  private:
    double limit_g_;
    Counts counts_g_;
    drivers::Time stale_after_;
    RestWindow platform_, table_;
    Doubt platform_doubt_, table_doubt_;
    Liveness platform_life_, table_life_;
    Snapshot<Rest> view_;
};

}  // namespace vibrig::rt
