#include "daemon/rt/real_clock.hpp"

#include <gtest/gtest.h>

#include <thread>

namespace vibrig::rt {
namespace {

using drivers::kMillisecond;
using drivers::kNever;
using drivers::Time;

TEST(RealClock, WakesAtTheDeadlineAndNotBefore) {
    RealClock clock;
    const auto waiter = clock.make_waiter();
    const Time deadline = clock.now() + 20 * kMillisecond;
    EXPECT_FALSE(waiter->wait_until(deadline));
    EXPECT_GE(clock.now(), deadline);
}

TEST(RealClock, ANoticeBeforeTheWaitIsNotLost) {
    RealClock clock;
    const auto waiter = clock.make_waiter();
    waiter->notify();
    waiter->notify();
    EXPECT_TRUE(waiter->wait_until(kNever));
    EXPECT_FALSE(waiter->wait_until(clock.now() + kMillisecond));
}

TEST(RealClock, ANoticeFromAnotherThreadWakes) {
    RealClock clock;
    const auto waiter = clock.make_waiter();
    std::thread other([&] { waiter->notify(); });
    EXPECT_TRUE(waiter->wait_until(kNever));
    other.join();
}

}  // namespace
}  // namespace vibrig::rt
