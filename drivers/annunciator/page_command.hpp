#pragma once

#include <sys/types.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "drivers/base/clock.hpp"

namespace vibrig::drivers {

/// Runs of a program of the user's that pages somebody. Each gets a text on its standard input, a
/// process group of its own and a limited time; nobody waits for it and its output goes nowhere.
/// When its first process ends or its time is up, the whole group is killed. One thread.
class PageCommand {
  public:
    static constexpr std::size_t kAtOnce = 4;
    /// Fits into a pipe, so that writing never waits.
    static constexpr std::size_t kLongestText = 4096;

    struct Counters {
        std::uint64_t started = 0;
        std::uint64_t done = 0;       ///< ended with status 0
        std::uint64_t failed = 0;     ///< not started, or ended with another status than 0
        std::uint64_t timed_out = 0;  ///< killed
    };

    PageCommand(std::string path, Time limit);
    ~PageCommand();  ///< kills what still runs
    PageCommand(const PageCommand&) = delete;
    PageCommand& operator=(const PageCommand&) = delete;

    [[nodiscard]] bool has_room() const noexcept { return runs_.size() < kAtOnce; }
    [[nodiscard]] bool idle() const noexcept { return runs_.empty(); }
    /// Needs room. What went wrong, in words; empty: started.
    [[nodiscard]] std::string start(const std::string& text, Time now);
    /// Looks after what runs, without waiting. What went wrong with one that is over, in words.
    [[nodiscard]] std::string attend(Time now);
    /// Why it cannot be run as it lies there now, before anybody needs it; empty: it can.
    [[nodiscard]] std::string trouble() const;
    [[nodiscard]] const Counters& counters() const noexcept { return counters_; }

  private:
    struct Run {
        pid_t leader = -1;
        Time until = 0;
        bool late = false;  ///< its time was up
    };
    /// Kills the group, takes the leader's exit status. Nothing if it still runs and may.
    [[nodiscard]] std::optional<std::string> conclude(Run& run, Time now);

    std::string path_;
    Time limit_;
    std::vector<Run> runs_;
    Counters counters_;
};

}  // namespace vibrig::drivers
