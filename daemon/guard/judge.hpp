#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "daemon/guard/settings.hpp"
#include "daemon/guard/witnesses.hpp"
#include "drivers/base/clock.hpp"
#include "proto/guard_words.hpp"

namespace vibrig::guard {

/// What the shaker's controller reports over the guard's own connection.
struct ShakerWord {
    bool known = false;  ///< read lately
    bool runs = false;
    double measured_g = 0;
};

/// All there is to judge by at one moment.
struct Evidence {
    drivers::Time now = 0;  ///< CLOCK_MONOTONIC
    drivers::Time rig = 0;  ///< the simulated rig's time where it owns the time, else now
    Sight sight;
    ShakerWord shaker;
    std::optional<proto::DaemonWord> word;  ///< the newest
    drivers::Time heard = 0;                ///< when, CLOCK_MONOTONIC
};

/// Decides by what is measured; of the daemon's words it believes only that somebody armed, up to
/// which level, that it excites, how much more the platform may show of that (within what the
/// configuration has), and that a stop was ordered. A duration has to have passed in wall time and,
/// where the simulated rig owns the time, in the rig's too: a rig that stands still is no danger,
/// and one at high speed is no faster than the words about it. No input or output, no clock.
class Judge {
  public:
    /// Findings are numbered from `first`, which no earlier life of the guard has used.
    Judge(const JudgeSettings& settings, std::uint64_t first) noexcept
        : settings_(settings), next_finding_(first) {}

    void judge(const Evidence& evidence) noexcept;
    /// A person has seen the finding. False while the table is not measured to be at rest.
    bool acknowledge() noexcept;

    [[nodiscard]] proto::GuardCause cause() const noexcept { return cause_; }
    /// Number of the newest finding; 0: none yet.
    [[nodiscard]] std::uint64_t finding() const noexcept { return finding_; }
    /// A stop has not been obeyed in its time, in this finding.
    [[nodiscard]] bool disobeyed() const noexcept { return disobeyed_; }
    /// Run is to be written as 0, again and again.
    [[nodiscard]] bool stop_wanted() const noexcept { return stop_wanted_; }
    [[nodiscard]] Tune tune() const noexcept;
    [[nodiscard]] bool rests() const noexcept { return rests_; }

  private:
    /// Since when a condition holds without a break.
    class Held {
      public:
        /// Whether it has held for so long.
        bool for_s(bool condition, const Moment& now, double seconds) noexcept;

      private:
        std::optional<Moment> since_;
    };
    [[nodiscard]] bool hangs(const Moment& now, const proto::DaemonWord& word) noexcept;
    [[nodiscard]] proto::GuardCause find(const Evidence& e, const Moment& now) noexcept;
    [[nodiscard]] bool shakes_unexcited(const Evidence& e, const Moment& now, bool armed) noexcept;
    void watch_stop(const Evidence& e, const Moment& now) noexcept;
    void found(proto::GuardCause cause) noexcept;

    JudgeSettings settings_;
    std::uint64_t next_finding_;
    std::optional<Moment> started_;
    bool moves_ = false, rests_ = false;

    std::array<std::uint64_t, 4> progress_{};
    std::array<Moment, 4> progressed_{};
    std::optional<Moment> allowed_;  ///< when it was armed or excited the last time
    std::optional<Moment> excited_;  ///< when it was excited the last time
    Held moving_, over_, quiet_, table_unexcited_, platform_unexcited_;
    bool forgotten_ = false;  ///< a silent daemon's arming: the table has rested since

    std::optional<Moment> ordered_;  ///< since when a stop is ordered and not obeyed
    bool stop_matters_ = false;      ///< something moved, or was to, when it was ordered
    bool obeyed_ = false;            ///< rest has been measured since

    proto::GuardCause cause_ = proto::GuardCause::none;
    std::uint64_t finding_ = 0;
    bool disobeyed_ = false, stop_wanted_ = false;
};

}  // namespace vibrig::guard
