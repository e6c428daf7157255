#include "drivers/can/receive_batch.hpp"

#include <gtest/gtest.h>

namespace vibrig::test {
namespace {

TEST(KernelStamp, IsCarriedToTheMonotonicClockWithItsAgeBounded) {
    const drivers::ClockPair clocks{.monotonic = 5'000'000'000,
                                    .realtime = 1'700'000'000'000'000'000};
    // GIVEN a stamp 3 ms old: it is 3 ms ago
    EXPECT_EQ(clocks.to_monotonic(clocks.realtime - 3'000'000), 4'997'000'000);
    // GIVEN a wall clock that was set forward by an hour in between: a second ago, not an hour
    EXPECT_EQ(clocks.to_monotonic(clocks.realtime - 3600 * drivers::kSecond), 4'000'000'000);
    // GIVEN one that was set back: now, not in the future
    EXPECT_EQ(clocks.to_monotonic(clocks.realtime + 3600 * drivers::kSecond), 5'000'000'000);
    // AND whole microseconds
    EXPECT_EQ(clocks.to_monotonic(clocks.realtime - 1'234) % 1000, 0);
}

}  // namespace
}  // namespace vibrig::test
