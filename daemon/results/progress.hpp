#pragma once

#include <chrono>
#include <cstddef>
#include <string>
#include <thread>

namespace vibrig::tool {

/// One line of progress on standard error, if that is a terminal and the work takes long enough to
/// wonder.
class Progress {
  public:
    explicit Progress(std::string what = {});
    ~Progress();  ///< clears the line
    Progress(const Progress&) = delete;
    Progress& operator=(const Progress&) = delete;

    void show(std::size_t done, std::size_t all);
    void show(const std::string& line);
    [[nodiscard]] bool on_terminal() const { return terminal_; }

  private:
    [[nodiscard]] bool is_time();

    using Clock = std::chrono::steady_clock;
    std::string what_;
    bool terminal_;
    bool shown_ = false;
    Clock::time_point next_;
};

/// The same for work whose steps nobody counts: how long it has taken so far.
class Working {
  public:
    explicit Working(std::string what);
    ~Working();  ///< clears the line
    Working(const Working&) = delete;
    Working& operator=(const Working&) = delete;

  private:
    std::jthread thread_;  ///< none without a terminal
};

}  // namespace vibrig::tool
