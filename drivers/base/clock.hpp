#pragma once

#include <chrono>
#include <cstdint>
#include <limits>
#include <memory>

namespace vibrig::drivers {

/// Time of a clock, ns. Monotonic, whole microseconds for samples. Zero is the clock's own origin.
using Time = std::int64_t;

inline constexpr Time kMicrosecond = 1'000;
inline constexpr Time kMillisecond = 1'000'000;
inline constexpr Time kSecond = 1'000'000'000;
inline constexpr Time kNever = std::numeric_limits<Time>::max();

[[nodiscard]] constexpr double to_seconds(Time t) { return static_cast<double>(t) * 1e-9; }
/// s to ns, rounded to the nearest whole microsecond; |s| below 9e9.
[[nodiscard]] constexpr Time from_seconds(double s) {
    return static_cast<Time>(s * 1e6 + (s < 0 ? -0.5 : 0.5)) * kMicrosecond;
}

/// CLOCK_MONOTONIC, whatever clock the rig has.
[[nodiscard]] inline Time steady_now() noexcept {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(
               std::chrono::steady_clock::now().time_since_epoch())
        .count();
}

/// Where one thread sleeps. Made by a Clock, owned by the thread that waits.
class Waiter {
  public:
    virtual ~Waiter() = default;
    /// Wakes the owner, now or at its next wait. Any thread; never blocks, locks or allocates.
    virtual void notify() noexcept = 0;
    /// Sleeps in a system call until notify() or until the clock reaches `deadline` (kNever: only
    /// notify()). Returns at once when notify() came before. True if notified, false if the
    /// deadline came. Called by the owner only.
    virtual bool wait_until(Time deadline) noexcept = 0;
};

/// The source of time. It comes in from outside: the real clock, the simulated rig's or a
/// recording's. Every thread that measures or acts sleeps on a Waiter of its clock and nowhere else
/// for long, so that a simulated clock knows when all of them are done with the present moment and
/// time may go on.
class Clock {
  public:
    virtual ~Clock() = default;
    [[nodiscard]] virtual Time now() const noexcept = 0;
    /// A Waiter must not outlive its Clock. From construction to the first wait_until its owner
    /// counts as busy.
    [[nodiscard]] virtual std::unique_ptr<Waiter> make_waiter() = 0;
};

}  // namespace vibrig::drivers
