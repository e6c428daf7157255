#pragma once

#include <atomic>
#include <mutex>
#include <vector>

#include "drivers/base/clock.hpp"
#include "drivers/base/event_fd.hpp"

namespace vibrig::rt {

/// Time owned by the simulated rig. The acquisition thread moves it as the rig says; deadlines fire
/// in the step that reaches them; the step is over when every thread with a Waiter sleeps again.
/// Only then the rig is acknowledged and goes on, so a busy machine makes a run slower and never
/// different.
class RigClock final : public drivers::Clock {
  public:
    [[nodiscard]] drivers::Time now() const noexcept override { return now_.load(); }
    [[nodiscard]] std::unique_ptr<drivers::Waiter> make_waiter() override;

    /// Moves time, fires no deadline. Time never goes back: an earlier `t` is ignored. Acquisition
    /// thread only.
    void set(drivers::Time t) noexcept;
    /// Fires all deadlines up to now(). Acquisition thread only.
    void fire() noexcept;
    /// True when every waiting thread sleeps and no wake-up is on its way.
    [[nodiscard]] bool at_rest() const noexcept { return busy_.load() == 0; }
    /// Becomes readable each time the last busy thread goes to sleep.
    [[nodiscard]] const EventFd& rest() const noexcept { return rest_; }

  private:
    class RigWaiter;
    // busy_ counts tokens: one per running thread, one per wake-up on its way to a sleeping thread.
    // A woken thread takes over the token of its wake-up, so the count cannot touch zero in
    // between.
    void take_token() noexcept { busy_.fetch_add(1); }
    void drop_token() noexcept {
        if (busy_.fetch_sub(1) == 1) rest_.signal();
    }

    std::atomic<drivers::Time> now_{0};
    std::atomic<int> busy_{0};
    EventFd rest_;
    std::mutex waiters_mutex_;  ///< contended only while threads start and end
    std::vector<RigWaiter*> waiters_;
};

}  // namespace vibrig::rt
