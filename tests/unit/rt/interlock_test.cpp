#include "daemon/rt/interlock.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "daemon/rt/real_clock.hpp"
#include "tests/unit/rt/fake_shaker.hpp"

namespace vibrig::rt {
namespace {

struct InterlockTest : testing::Test {
    RealClock clock;
    std::unique_ptr<drivers::Waiter> control = clock.make_waiter();
    FakeShaker shaker;
    Interlock interlock{shaker, *control, {12.0}};
    drivers::Sample sample;
    drivers::PlatformStatus platform;

    InterlockTest() {
        sample.quality.fill(drivers::Quality::good);
        platform.loop_closed = true;
    }
};

TEST_F(InterlockTest, StopsAndWakesTheControlThreadOnAnOpenLoop) {
    interlock.watch(true);
    platform.loop_closed = false;
    interlock.check(sample, platform);
    EXPECT_EQ(interlock.tripped(), Trip::loop_open);
    EXPECT_EQ(shaker.stops, 1);
    EXPECT_TRUE(control->wait_until(clock.now() + drivers::kSecond));
}

TEST_F(InterlockTest, StaysLatchedWithTheFirstCauseUntilAcknowledged) {
    interlock.watch(true);
    platform.loop_closed = false;
    interlock.check(sample, platform);
    platform.loop_closed = true;
    sample.table_accel = 13;
    interlock.check(sample, platform);
    EXPECT_EQ(interlock.tripped(), Trip::loop_open);
    EXPECT_EQ(shaker.stops, 1);
    interlock.acknowledge();
    interlock.check(sample, platform);
    EXPECT_EQ(interlock.tripped(), Trip::over_amplitude);
}

TEST_F(InterlockTest, TakesANanForAnOverAmplitude) {
    interlock.watch(true);
    sample.table_accel = std::numeric_limits<double>::quiet_NaN();
    interlock.check(sample, platform);
    EXPECT_EQ(interlock.tripped(), Trip::over_amplitude);
}

TEST_F(InterlockTest, TripsOnTheEmergencyStopAndOnALostBus) {
    interlock.watch(true);
    drivers::ShakerReading reading;
    reading.valid = true;
    reading.emergency_stop_open = true;
    interlock.check(reading);
    EXPECT_EQ(interlock.tripped(), Trip::emergency_stop);
    interlock.acknowledge();
    interlock.lost_bus();
    EXPECT_EQ(interlock.tripped(), Trip::can_lost);
}

TEST_F(InterlockTest, IsSilentWhileNothingMayMove) {
    platform.loop_closed = false;
    sample.table_accel = 99;
    interlock.check(sample, platform);
    interlock.lost_bus();
    EXPECT_EQ(interlock.tripped(), Trip::none);
    EXPECT_EQ(shaker.stops, 0);
}

}  // namespace
}  // namespace vibrig::rt
