#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>

namespace vibrig::log {

struct Counts {
    std::uint64_t taken = 0, written = 0;
    std::uint64_t dropped = 0;  ///< the oldest of a full queue, and what the descriptor refused
    std::uint64_t waiting = 0;  ///< taken = written + dropped + waiting, at any moment
    bool blocked = false;       ///< the oldest has waited for more than a second
};

/// Lines on their way to a descriptor that may block for ever: a terminal after Ctrl-S, a full
/// pipe, a dead disk. Whoever puts a line never waits for it. (spdlog's own queue would: its end
/// waits until all is written.)
class LogQueue {
  public:
    static constexpr std::size_t kMostWaiting = 2000;

    /// Does not close the descriptor.
    explicit LogQueue(int descriptor, std::size_t most_waiting = kMostWaiting);
    /// Leaves what still waits to the descriptor's mercy: see end().
    ~LogQueue();
    LogQueue(const LogQueue&) = delete;
    LogQueue& operator=(const LogQueue&) = delete;

    /// Any thread but real-time ones: it locks, shortly, and allocates. The line has its end with
    /// it.
    void put(std::string line);
    [[nodiscard]] Counts counts() const;
    /// Waits until all is written; false: it was not within that time, and is given up.
    bool end(std::chrono::milliseconds patience);

  private:
    struct State;
    static void write_all(const std::shared_ptr<State>& state);

    // The thread's as well: it may outlive this object inside a write that never returns.
    const std::shared_ptr<State> state_;
    std::thread thread_;
};

}  // namespace vibrig::log
