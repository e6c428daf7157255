#include "drivers/sample/sync_clock.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <random>

namespace vibrig::drivers {
namespace {

constexpr Time kPeriod = 25 * kMillisecond;
constexpr Time kStart = 123'456 * kMillisecond;

TEST(SyncClock, ReproducesRegularStampsExactly) {
    // GIVEN stamps at the nominal period, and at others it does not know: 0.1 % and 3 % off
    for (const Time period : {kPeriod, kPeriod + 25 * kMicrosecond, kPeriod - 750 * kMicrosecond}) {
        SyncClock clock(kPeriod);
        for (std::int64_t count = 0; count < 1000; ++count) {
            const Time stamp = kStart + count * period;
            clock.observe(count, stamp);
            // THEN each comes out as it went in. Only the second one may be held for a delayed one.
            if (count != 1) {
                EXPECT_EQ(clock.time_of(count), stamp) << period << " " << count;
            }
        }
    }
}

TEST(SyncClock, FollowsTheDeviceAndNotTheDelaysOfTheBus) {
    // GIVEN a device 80 ppm fast, each stamp late by a uniform 0 to 100 us, and one in ten late by
    // up to 20 ms more
    const unsigned seed = 20261;
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> delay(0, 100e3);
    std::uniform_real_distribution<double> wake_up(1e6, 20e6);
    std::bernoulli_distribution late(0.1);
    const double period = static_cast<double>(kPeriod) * (1 - 80e-6);
    SyncClock clock(kPeriod);
    double sum_square = 0;
    int n = 0;
    for (std::int64_t count = 0; count < 5000; ++count) {
        const double device = static_cast<double>(kStart) + static_cast<double>(count) * period;
        clock.observe(count, static_cast<Time>(device + delay(random) +
                                               (late(random) ? wake_up(random) : 0)));
        if (count < 64) continue;
        // THEN the time is the device's plus the mean delay of 50 us; the end of a straight line
        // through n points has the standard deviation 2 sigma / sqrt(n): 2 * 28.9 us / sqrt(57)
        // = 7.7 us
        const double error = static_cast<double>(clock.time_of(count)) - device - 50e3;
        EXPECT_LT(std::abs(error), 6 * 7.7e3) << count;
        sum_square += error * error;
        ++n;
    }
    EXPECT_LT(std::sqrt(sum_square / n), 1.3 * 7.7e3);
}

TEST(SyncClock, IsNotMovedByOneStampFarOff) {
    SyncClock clock(kPeriod);
    for (std::int64_t count = 0; count < 200; ++count) {
        const Time device = kStart + count * kPeriod;
        // GIVEN one stamp a second late, and one 20 ms late
        const Time delay = count == 100 ? kSecond : count == 150 ? 20 * kMillisecond : 0;
        EXPECT_FALSE(clock.observe(count, device + delay));
        EXPECT_EQ(clock.time_of(count), device) << count;
    }
}

TEST(SyncClock, KeepsTheDeviceTimeThroughABurstAfterAPause) {
    // GIVEN a reader that slept for a second: 40 stamps all the same, then regular again
    SyncClock clock(kPeriod);
    for (std::int64_t count = 0; count < 300; ++count) {
        const Time device = kStart + count * kPeriod;
        const Time stamp = count >= 100 && count < 140 ? kStart + 140 * kPeriod : device;
        EXPECT_FALSE(clock.observe(count, stamp));
        EXPECT_EQ(clock.time_of(count), device) << count;
    }
}

TEST(SyncClock, KeepsTheDeviceTimeWhileWhatWasHeldUpCatchesUp) {
    // GIVEN a gateway that stood still for 12 periods and then hands on somewhat faster than
    // anything comes, until it has nothing left
    SyncClock clock(kPeriod);
    Time handed_on = 0;
    for (std::int64_t count = 0; count < 300; ++count) {
        const Time device = kStart + count * kPeriod;
        const Time least = count >= 100 ? kStart + 112 * kPeriod : 0;
        handed_on = std::max({device, least, handed_on + kPeriod * 7 / 10});
        EXPECT_FALSE(clock.observe(count, handed_on));
        // THEN its times stay
        EXPECT_EQ(clock.time_of(count), device) << count;
    }
}

TEST(SyncClock, AGatewayThatIsBehindForMillisecondsMovesNoFastCounts) {
    // GIVEN samples at 1 and 10 kHz, and a gateway that is 8 ms behind for 30 of each 110 ms
    for (const Time period : {kMillisecond, kMillisecond / 10}) {
        SyncClock clock(period);
        for (std::int64_t count = 0; count < 5 * kSecond / period; ++count) {
            const Time since = count * period;
            const bool behind = since > kSecond && since % (110 * kMillisecond) < 30 * kMillisecond;
            EXPECT_FALSE(clock.observe(count, kStart + since + (behind ? 8 * kMillisecond : 0)));
            // THEN the times are the device's, those that came late, too
            ASSERT_EQ(clock.time_of(count), kStart + since) << period << " " << count;
        }
    }
}

TEST(SyncClock, BeginsAnewWhenTheStampsStepForGood) {
    SyncClock clock(kPeriod);
    for (std::int64_t count = 0; count < 200; ++count) {
        // GIVEN a device that stood still for 10 s between two counts
        const Time stamp = kStart + count * kPeriod + (count >= 100 ? 10 * kSecond : 0);
        EXPECT_EQ(clock.observe(count, stamp), count == 103);
        // THEN three stamps are not believed, the fourth is
        if (count < 100 || count >= 103) {
            EXPECT_EQ(clock.time_of(count), stamp) << count;
        }
    }
}

TEST(SyncClock, SurvivesAFirstStampThatWasLate) {
    SyncClock clock(kPeriod);
    clock.observe(0, kStart + 20 * kMillisecond);
    for (std::int64_t count = 1; count < 20; ++count) {
        clock.observe(count, kStart + count * kPeriod);
        EXPECT_EQ(clock.time_of(count), kStart + count * kPeriod) << count;
    }
}

TEST(SyncClock, TimesCountsThatNeverCame) {
    // GIVEN every second Sync frame lost
    SyncClock clock(kPeriod);
    for (std::int64_t count = 0; count < 200; count += 2)
        clock.observe(count, kStart + count * kPeriod);
    // THEN the ones between and after have their place
    EXPECT_EQ(clock.time_of(151), kStart + 151 * kPeriod);
    EXPECT_EQ(clock.time_of(250), kStart + 250 * kPeriod);
    // AND an old count moves nothing
    clock.observe(10, kStart);
    EXPECT_EQ(clock.time_of(199), kStart + 199 * kPeriod);
}

TEST(SyncClock, ForgetsWhenAskedTo) {
    SyncClock clock(kPeriod);
    EXPECT_EQ(clock.time_of(5), 0);
    for (std::int64_t count = 500; count < 600; ++count)
        clock.observe(count, kStart + count * kPeriod);
    clock.reset();
    clock.observe(0, kStart);
    EXPECT_EQ(clock.time_of(0), kStart);
    EXPECT_EQ(clock.time_of(2), kStart + 2 * kPeriod);
}

}  // namespace
}  // namespace vibrig::drivers
