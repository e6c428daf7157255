#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <functional>
#include <string>

#include "daemon/interlock/rest_monitor.hpp"
#include "drivers/shaker/shaker.hpp"
#include "proto/safety.hpp"

namespace vibrig::campaign {

/// How long the platform swings on its pads after the table below it stands.
struct PadRingDown {
    double level_g = 0;     ///< at the table, of the stop that was measured
    double time_s = 0;      ///< it took there
    double rate_per_s = 0;  ///< of the decay; 0: not measured, an allowance instead
    /// Duration of a stop from `table_g`: logarithmic in the level.
    [[nodiscard]] double from_s(double table_g) const;
};

struct StopSettings {
    double deadline_s = safety::kStopDeadline_s;  ///< from the order to rest, table and controller
    PadRingDown pads;
};

/// Whether a stop was obeyed. An order is done only when the controller reads run 0, the measured
/// amplitude is still and the accelerometers have measured rest for a whole window since; until
/// then it is stopping, and the watchdog starves. What is not at rest in its time is disobedience,
/// which latches. Orders are counted by the shaker itself, so that one from any thread counts at
/// once. Where nothing was asked for, what the accelerometers see for a second is motion that
/// nobody commanded, whatever the controller reports.
class StopMonitor {
  public:
    using Rest = std::function<rt::Rest(drivers::Time)>;  ///< none: nobody knows, nothing is rest
    StopMonitor(const drivers::Shaker& shaker, Rest rest, const StopSettings& settings);

    /// Any thread: a stop is ordered, and rest has not been measured since.
    [[nodiscard]] bool stopping() const noexcept { return shaker_.stops() != rested_.load(); }

    // Control thread.

    /// A level was asked for, peak at the table: from now on silence is no rest.
    void excited(double table_g) noexcept { level_g_ = std::max(level_g_, table_g); }
    [[nodiscard]] bool excited() const noexcept { return level_g_ > 0; }
    /// As the newest proof has measured them.
    void pads(const PadRingDown& pads) noexcept { settings_.pads = pads; }
    /// After a planned ramp down, with rest measured.
    void at_rest() noexcept { level_g_ = 0; }
    [[nodiscard]] rt::Rest rest(drivers::Time now) const { return rest_ ? rest_(now) : rt::Rest{}; }

    enum class News : std::uint8_t { none, confirmed, disobeyed, uncommanded };
    /// Each is reported once. `handled`: gimbals or people move the platform, so that its
    /// accelerometers tell of the table below it only by what no slew does. Where a table
    /// accelerometer shows the table, they are not asked.
    [[nodiscard]] News update(drivers::Time now, bool handled = false);
    [[nodiscard]] bool disobeyed() const noexcept { return disobeyed_; }
    /// Once it is at rest.
    void acknowledge() noexcept { disobeyed_ = false; }
    /// From the order until now, or until rest.
    [[nodiscard]] double took_s() const noexcept { return took_s_; }
    /// What is not at rest, or what nobody can tell of; empty: nothing.
    [[nodiscard]] std::string what_moves(drivers::Time now) const;
    /// Something moves, or may: not to be left alone. Without excitation only what is seen counts,
    /// since a rig that is switched off tells nothing.
    [[nodiscard]] bool unsettled(drivers::Time now) const;
    /// Longest time from an order to the verdict.
    [[nodiscard]] double longest_s(double table_g) const {
        return settings_.deadline_s + settings_.pads.from_s(table_g);
    }

  private:
    [[nodiscard]] bool late(drivers::Time now) const;
    [[nodiscard]] bool uncommanded(drivers::Time now, bool handled);

    const drivers::Shaker& shaker_;
    Rest rest_;
    StopSettings settings_;
    std::atomic<std::uint64_t> rested_{0};  ///< orders after which rest was measured
    drivers::Time since_ = 0;               ///< of the order; 0: none is open
    double level_g_ = 0;                    ///< highest since rest was measured
    double took_s_ = 0;
    bool disobeyed_ = false;
    drivers::Time moves_since_ = 0;  ///< though nothing was asked for; 0: it does not
    bool uncommanded_reported_ = false;
};

}  // namespace vibrig::campaign
