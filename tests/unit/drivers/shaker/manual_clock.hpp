#pragma once

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <utility>

#include "drivers/base/clock.hpp"

namespace vibrig::drivers::test {

/// A clock that stands still until it is set, for one waiter.
class ManualClock final : public Clock {
  public:
    [[nodiscard]] Time now() const noexcept override {
        const std::lock_guard lock(mutex_);
        return now_;
    }
    [[nodiscard]] std::unique_ptr<Waiter> make_waiter() override {
        return std::make_unique<ManualWaiter>(*this);
    }
    /// Waits until the waiter sleeps and has not been woken; the time it sleeps until. Throws after
    /// a minute.
    [[nodiscard]] Time rest() {
        std::unique_lock lock(mutex_);
        if (!changed_.wait_for(lock, std::chrono::seconds(60),
                               [&] { return asleep_ && !notified_ && deadline_ > now_; })) {
            throw std::runtime_error("the thread does not come to rest");
        }
        return deadline_;
    }
    void set(Time now) {
        const std::lock_guard lock(mutex_);
        now_ = now;
        changed_.notify_all();
    }

  private:
    class ManualWaiter final : public Waiter {
      public:
        explicit ManualWaiter(ManualClock& clock) : clock_(clock) {}
        void notify() noexcept override {
            const std::lock_guard lock(clock_.mutex_);
            clock_.notified_ = true;
            clock_.changed_.notify_all();
        }
        bool wait_until(Time deadline) noexcept override {
            std::unique_lock lock(clock_.mutex_);
            clock_.deadline_ = deadline;
            clock_.asleep_ = true;
            clock_.changed_.notify_all();
            clock_.changed_.wait(lock, [&] { return clock_.notified_ || clock_.now_ >= deadline; });
            clock_.asleep_ = false;
            return std::exchange(clock_.notified_, false);
        }

      private:
        ManualClock& clock_;
    };

    mutable std::mutex mutex_;
    std::condition_variable changed_;
    Time now_ = 0, deadline_ = 0;
    bool asleep_ = false, notified_ = false;
};

}  // namespace vibrig::drivers::test
