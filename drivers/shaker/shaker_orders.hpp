#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <optional>

#include "drivers/shaker/shaker.hpp"

namespace vibrig::drivers {

/// What the shaker's thread has been ordered to write: a stop, or else at most one set-point.
/// Stopping is lock-free. A set-point carries the stop count it was requested under and is void
/// once that has moved, so none that was requested before a stop can be written after it, whatever
/// threads were preempted where.
class ShakerOrders {
  public:
    /// Any thread. True if no stop was pending before.
    bool stop() noexcept {
        std::uint64_t seen = stop_.load();
        while (!stop_.compare_exchange_weak(seen, (seen + kOneStop) | kPending)) {
        }
        return (seen & kPending) == 0;
    }
    [[nodiscard]] bool stop_pending() const noexcept { return (stop_.load() & kPending) != 0; }
    /// Shaker thread only: the run register has been read back as 0 and nothing was written since.
    void stop_done() noexcept { stop_.fetch_and(~kPending); }

    /// What request() has to look at before it decides.
    struct Ticket {
        std::uint64_t stop = 0;
        std::uint64_t link = 0;
        [[nodiscard]] bool stop_pending() const noexcept { return (stop & kPending) != 0; }
        [[nodiscard]] std::uint64_t stops() const noexcept { return stop / kOneStop; }
    };
    [[nodiscard]] Ticket ticket() const noexcept { return {stop_.load(), link_.load()}; }
    /// Any thread. True if a waiting set-point was replaced.
    bool put(const ShakerSetPoint& set_point, const Ticket& ticket) noexcept {
        const std::lock_guard lock(mutex_);
        const bool replaced = waiting_.load();
        set_point_ = set_point;
        ticket_ = ticket;
        waiting_ = true;
        return replaced;
    }
    [[nodiscard]] bool waiting() const noexcept { return waiting_.load(); }
    /// True while one waits or is being written.
    [[nodiscard]] bool busy() const noexcept { return waiting_.load() || writing_.load(); }

    /// Shaker thread only. True if a waiting set-point had become void and was dropped.
    bool drop_void() noexcept {
        const std::lock_guard lock(mutex_);
        if (!waiting_.load() || !is_void()) return false;
        waiting_ = false;
        return true;
    }
    /// Shaker thread only. The waiting set-point, to be written now; finished() ends it.
    [[nodiscard]] std::optional<ShakerSetPoint> take() noexcept {
        const std::lock_guard lock(mutex_);
        if (!waiting_.load() || is_void()) return std::nullopt;
        writing_ = true;  // before waiting_ ends, so that busy() has no gap
        waiting_ = false;
        return set_point_;
    }
    void finished() noexcept { writing_ = false; }
    /// Shaker thread only: the link is gone; what waits was meant for a device as it was then.
    void link_lost() noexcept { ++link_; }

  private:
    static constexpr std::uint64_t kPending = 1, kOneStop = 2;
    [[nodiscard]] bool is_void() const noexcept {
        return ticket_.stop != stop_.load() || ticket_.link != link_.load();
    }

    std::atomic<std::uint64_t> stop_{0};  ///< bit 0: pending; above: count
    std::atomic<std::uint64_t> link_{0};  ///< count of lost links
    std::atomic<bool> waiting_{false}, writing_{false};
    std::mutex mutex_;  ///< between requests and the shaker thread only
    ShakerSetPoint set_point_;
    Ticket ticket_;
};

}  // namespace vibrig::drivers
