#pragma once

#include <atomic>
#include <memory>
#include <utility>

#include "drivers/base/clock.hpp"

namespace vibrig::rt {

/// A waiter that remembers whether what woke it belongs to the clock's time. The journal's thread
/// ends a write at a moment of the machine's: its wake() lets the owner look at what has been
/// written, and must not decide at which sample a campaign goes on. take() by the owner only.
class StirredWaiter final : public drivers::Waiter {
  public:
    explicit StirredWaiter(std::unique_ptr<drivers::Waiter> inner) : inner_(std::move(inner)) {}

    void notify() noexcept override {
        stirred_.store(true);
        inner_->notify();
    }
    void wake() noexcept { inner_->notify(); }
    bool wait_until(drivers::Time deadline) noexcept override {
        return inner_->wait_until(deadline);
    }
    /// Whether notify() has been called since the last time.
    [[nodiscard]] bool take() noexcept { return stirred_.exchange(false); }

  private:
    std::unique_ptr<drivers::Waiter> inner_;
    std::atomic<bool> stirred_{false};
};

}  // namespace vibrig::rt
