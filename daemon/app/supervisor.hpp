#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <string>

#include "daemon/app/balance.hpp"
#include "daemon/app/parts.hpp"
#include "daemon/journal/latches.hpp"

namespace vibrig {

/// Watches, because nobody else is there, whether everything goes on: alarms, balances, stages that
/// are stuck. Control thread, except where it says another.
class Supervisor {
  public:
    Supervisor(Parts& parts, journal::Latches& latches) : parts_(parts), latches_(latches) {}

    /// The control thread is alive.
    void beat(drivers::Time now) noexcept { control_beat_.store(now); }
    /// Tells what has changed since the last time; `guard_lacks`: why vibrig-guard does not watch.
    void look(const std::string& guard_lacks);
    /// Once a second; see Balance.
    void check_balance(drivers::Time now);
    /// A row of the table alarms.
    [[nodiscard]] bool alarm_raised() const noexcept {
        return std::ranges::find(raised_, true) != raised_.end();
    }

    /// Any one thread: the stages that measure or act and have ceased to; empty: all go on.
    [[nodiscard]] std::string stuck_stage();
    /// The shaker's thread: everybody goes on, and nobody stops the table.
    [[nodiscard]] bool may_feed() const noexcept;
    /// The server's thread: it has taken a status.
    void served() noexcept { serving_steady_ns_.store(drivers::steady_now()); }
    /// Any thread: how far the control thread is.
    [[nodiscard]] std::uint64_t control_mark() const noexcept {
        return static_cast<std::uint64_t>(control_beat_.load());
    }

  private:
    void log(Severity severity, const std::string& source, const std::string& text) {
        parts_.events.log(severity, source, text);
    }
    void tell_alarms(const std::string& guard_lacks);
    void tell_controller();
    void tell_watchdog();
    void tell_journal();
    void tell_recorder();
    void tell_log();
    void watch_onlookers();
    void tell_clock_misfit();
    void tell_contradiction(const drivers::AssemblerCounters& counters, drivers::Time now);

    Parts& parts_;
    journal::Latches& latches_;
    const configuration::Configuration& configuration_ = parts_.configuration;
    const log::LogQueue* const log_queue_ = parts_.log_queue;
    const std::unique_ptr<drivers::Shaker>& shaker_ = parts_.shaker;
    rt::Interlock& interlock_ = parts_.interlock;
    const rt::EstimatorStage& estimator_stage_ = parts_.estimator_stage;
    const rt::Acquisition& acquisition_ = parts_.acquisition;
    const std::unique_ptr<journal::Journal>& journal_ = parts_.journal;
    const std::unique_ptr<record::Recorder>& recorder_ = parts_.recorder;

    // As last logged.
    std::array<bool, rt::kMostRules> raised_{};
    drivers::ControllerState controller_logged_ = drivers::ControllerState::active;
    bool watchdog_was_changed_ = false, journal_was_running_ = true, recorder_was_stuck_ = false,
         log_was_blocked_ = false;
    Balance balance_;
    std::string imbalance_;
    drivers::Time balance_checked_ = 0, contradiction_told_ = 0;
    std::uint64_t contradicting_ = 0;
    std::string misfit_logged_;  ///< thread of stuck_stage()

    std::atomic<drivers::Time> control_beat_{0};
    std::atomic<std::int64_t> serving_steady_ns_{0};  ///< 0: there is no server
    /// How far each stage was when it last went on, for stuck_stage().
    struct Progress {
        std::uint64_t mark = 0;
        std::int64_t since_ns = 0;  ///< wall
    };
    std::array<Progress, 4> progress_{};
};

}  // namespace vibrig
