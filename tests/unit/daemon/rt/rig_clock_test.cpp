#include "daemon/rt/rig_clock.hpp"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <memory>
#include <thread>
#include <vector>

namespace vibrig::rt {
namespace {

using drivers::kMillisecond;
using drivers::kNever;
using drivers::Time;

/// Blocks until the clock is at rest, as the acquisition thread does through its io_context.
void wait_for_rest(RigClock& clock) {
    while (!clock.at_rest()) {
        clock.rest().wait(10 * kMillisecond);
        clock.rest().clear();
    }
}

TEST(RigClock, IsNotAtRestUntilEveryOwnerSleeps) {
    RigClock clock;
    EXPECT_TRUE(clock.at_rest());
    auto waiter = clock.make_waiter();
    EXPECT_FALSE(clock.at_rest());
    std::thread owner([&] { waiter->wait_until(kNever); });
    wait_for_rest(clock);
    waiter->notify();
    EXPECT_FALSE(clock.at_rest());
    owner.join();
    waiter.reset();
    EXPECT_TRUE(clock.at_rest());
}

TEST(RigClock, TimeNeverGoesBack) {
    RigClock clock;
    clock.set(100);
    clock.set(50);
    EXPECT_EQ(clock.now(), 100);
}

TEST(RigClock, ADeadlineInThePastReturnsAtOnce) {
    RigClock clock;
    clock.set(100);
    const auto waiter = clock.make_waiter();
    EXPECT_FALSE(waiter->wait_until(100));
}

TEST(RigClock, EveryDeadlineFiresInItsOwnStepWhateverTheThreadsDo) {
    // GIVEN three threads with periods of 25, 50 and 75 ms that write down when they ran, and wake
    // one another
    RigClock clock;
    std::array<std::unique_ptr<drivers::Waiter>, 3> waiters;
    for (auto& w : waiters) w = clock.make_waiter();
    std::array<std::vector<Time>, 3> ran;
    std::atomic<bool> stop{false};
    std::vector<std::thread> threads;
    for (std::size_t k = 0; k < 3; ++k) {
        threads.emplace_back([&, k] {
            const Time period = static_cast<Time>(k + 1) * 25 * kMillisecond;
            Time next = period;
            while (!stop.load()) {
                if (clock.now() >= next) {
                    ran[k].push_back(clock.now());
                    next += period;
                    waiters[(k + 1) % 3]->notify();
                }
                waiters[k]->wait_until(next);
            }
        });
    }
    wait_for_rest(clock);
    // WHEN the rig makes 2000 steps of 25 ms, waiting for rest after each
    for (int step = 1; step <= 2000; ++step) {
        clock.set(step * 25 * kMillisecond);
        clock.fire();
        wait_for_rest(clock);
    }
    stop.store(true);
    for (auto& w : waiters) w->notify();
    for (auto& t : threads) t.join();
    // THEN each ran at every multiple of its period and at no other time
    for (std::size_t k = 0; k < 3; ++k) {
        const Time period = static_cast<Time>(k + 1) * 25 * kMillisecond;
        ASSERT_EQ(ran[k].size(), 2000 / (k + 1));
        for (std::size_t i = 0; i < ran[k].size(); ++i)
            ASSERT_EQ(ran[k][i], static_cast<Time>(i + 1) * period);
    }
}

}  // namespace
}  // namespace vibrig::rt
