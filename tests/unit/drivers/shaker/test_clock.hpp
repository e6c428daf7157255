#pragma once

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <ctime>

#include "drivers/base/clock.hpp"

namespace vibrig::drivers::test {

/// CLOCK_MONOTONIC, waiting on an eventfd.
class RealClock final : public Clock {
  public:
    [[nodiscard]] Time now() const noexcept override {
        timespec t{};
        ::clock_gettime(CLOCK_MONOTONIC, &t);
        return t.tv_sec * kSecond + t.tv_nsec;
    }
    [[nodiscard]] std::unique_ptr<Waiter> make_waiter() override {
        return std::make_unique<EventWaiter>(*this);
    }

  private:
    class EventWaiter final : public Waiter {
      public:
        explicit EventWaiter(const RealClock& clock) : clock_(clock) {}
        ~EventWaiter() override { ::close(event_); }
        EventWaiter(const EventWaiter&) = delete;
        EventWaiter& operator=(const EventWaiter&) = delete;

        void notify() noexcept override { ::eventfd_write(event_, 1); }
        bool wait_until(Time deadline) noexcept override {
            for (;;) {
                eventfd_t count = 0;
                if (::eventfd_read(event_, &count) == 0) return true;
                const Time left = deadline - clock_.now();
                if (left <= 0) return false;
                const timespec timeout{left / kSecond, left % kSecond};
                pollfd events{event_, POLLIN, 0};
                ::ppoll(&events, 1, deadline == kNever ? nullptr : &timeout, nullptr);
            }
        }

      private:
        const RealClock& clock_;
        const int event_ = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    };
};

}  // namespace vibrig::drivers::test
