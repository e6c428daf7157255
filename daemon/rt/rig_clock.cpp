#include "daemon/rt/rig_clock.hpp"

namespace vibrig::rt {

using drivers::kNever;
using drivers::Time;

class RigClock::RigWaiter final : public drivers::Waiter {
  public:
    explicit RigWaiter(RigClock& clock) : clock_(clock) {
        clock_.take_token();
        const std::lock_guard lock(clock_.waiters_mutex_);
        clock_.waiters_.push_back(this);
    }

    ~RigWaiter() override {
        {
            const std::lock_guard lock(clock_.waiters_mutex_);
            std::erase(clock_.waiters_, this);
        }
        if (pending_.exchange(false)) clock_.drop_token();
        clock_.drop_token();
    }

    RigWaiter(const RigWaiter&) = delete;
    RigWaiter& operator=(const RigWaiter&) = delete;

    void notify() noexcept override {
        clock_.take_token();  // before the flag: the sleeper may take it over at once
        if (pending_.exchange(true)) {
            clock_.drop_token();
        } else {
            event_.signal();
        }
    }

    bool wait_until(Time deadline) noexcept override {
        if (pending_.exchange(false)) {  // the token for running stays, the wake-up's goes
            clock_.drop_token();
            return true;
        }
        deadline_.store(deadline);
        // Looked at after the store: either this sees the new time or fire() sees the deadline.
        if (deadline <= clock_.now()) {
            deadline_.store(kNever);
            return false;
        }
        clock_.drop_token();
        for (;;) {
            if (event_.wait(-1)) event_.clear();
            if (pending_.exchange(false)) break;  // its token is now this thread's
        }
        deadline_.store(kNever);
        return deadline > clock_.now();
    }

    void fire(Time now) noexcept {
        if (deadline_.load() <= now) notify();
    }

  private:
    RigClock& clock_;
    EventFd event_;
    std::atomic<bool> pending_{false};
    std::atomic<Time> deadline_{kNever};
};

std::unique_ptr<drivers::Waiter> RigClock::make_waiter() {
    return std::make_unique<RigWaiter>(*this);
}

void RigClock::set(Time t) noexcept {
    if (t > now_.load(std::memory_order_relaxed)) now_.store(t);
}

void RigClock::fire() noexcept {
    const Time t = now();
    const std::lock_guard lock(waiters_mutex_);
    for (RigWaiter* waiter : waiters_) waiter->fire(t);
}

}  // namespace vibrig::rt
