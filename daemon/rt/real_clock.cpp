#include "daemon/rt/real_clock.hpp"

#include <atomic>

#include "drivers/base/event_fd.hpp"

namespace vibrig::rt {
namespace {

class RealWaiter final : public drivers::Waiter {
  public:
    void notify() noexcept override {
        if (!pending_.exchange(true)) event_.signal();
    }

    bool wait_until(drivers::Time deadline) noexcept override {
        for (;;) {
            if (pending_.exchange(false)) return true;
            long long left = -1;
            if (deadline != drivers::kNever) {
                left = deadline - drivers::steady_now();
                if (left <= 0) return false;
            }
            if (event_.wait(left)) event_.clear();
        }
    }

  private:
    EventFd event_;
    std::atomic<bool> pending_{false};
};

}  // namespace

drivers::Time RealClock::now() const noexcept { return drivers::steady_now(); }

std::unique_ptr<drivers::Waiter> RealClock::make_waiter() { return std::make_unique<RealWaiter>(); }

}  // namespace vibrig::rt
