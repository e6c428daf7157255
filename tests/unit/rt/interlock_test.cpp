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
    interlock.guard(Guard::excitation);
    platform.loop_closed = false;
    interlock.check(sample, platform);
    EXPECT_EQ(interlock.tripped(), Trip::loop_open);
    EXPECT_EQ(shaker.stops, 1);
    EXPECT_TRUE(control->wait_until(clock.now() + drivers::kSecond));
}

TEST_F(InterlockTest, StaysLatchedWithTheFirstCauseUntilAcknowledged) {
    interlock.guard(Guard::excitation);
    platform.loop_closed = false;
    interlock.check(sample, platform);
    platform.loop_closed = true;
    sample.table_accel = 13;
    interlock.check(sample, platform);
    EXPECT_EQ(interlock.tripped(), Trip::loop_open);
    EXPECT_EQ(shaker.stops, 1);
    interlock.acknowledge(Trip::over_amplitude);
    EXPECT_EQ(interlock.tripped(), Trip::loop_open) << "another cause than the handled one stays";
    interlock.acknowledge(Trip::loop_open);
    interlock.check(sample, platform);
    EXPECT_EQ(interlock.tripped(), Trip::over_amplitude);
}

TEST_F(InterlockTest, TakesANanForAnOverAmplitude) {
    interlock.guard(Guard::excitation);
    sample.table_accel = std::numeric_limits<double>::quiet_NaN();
    interlock.check(sample, platform);
    EXPECT_EQ(interlock.tripped(), Trip::over_amplitude);
}

TEST_F(InterlockTest, TripsOnTheEmergencyStopAndOnALostBus) {
    interlock.guard(Guard::excitation);
    drivers::ShakerReading reading;
    reading.valid = true;
    reading.emergency_stop_open = true;
    interlock.check(reading);
    EXPECT_EQ(interlock.tripped(), Trip::emergency_stop);
    interlock.acknowledge(Trip::emergency_stop);
    interlock.lost_bus();
    EXPECT_EQ(interlock.tripped(), Trip::can_lost);
}

TEST_F(InterlockTest, TakesPlatformAndTableForNothingWhileNothingMayMove) {
    platform.loop_closed = false;
    sample.table_accel = 99;
    interlock.check(sample, platform);
    interlock.lost_bus();
    EXPECT_EQ(interlock.tripped(), Trip::none);
    EXPECT_EQ(shaker.stops, 0);
}

TEST_F(InterlockTest, WatchesEmergencyStopFaultsAndBusFromTheArmingOn) {
    drivers::ShakerReading reading;
    reading.valid = true;
    reading.fault = 2;
    interlock.check(reading);
    EXPECT_EQ(interlock.tripped(), Trip::none);
    interlock.guard(Guard::armed);
    interlock.check(reading);
    EXPECT_EQ(interlock.tripped(), Trip::shaker_fault);
    interlock.acknowledge(Trip::shaker_fault);
    interlock.lost_bus();
    EXPECT_EQ(interlock.tripped(), Trip::can_lost);
}

TEST_F(InterlockTest, StopsAShakerThatNobodyCommanded) {
    // GIVEN a disarmed daemon and a shaker that runs, left over or started at its panel
    drivers::ShakerReading reading;
    reading.valid = true;
    reading.running = true;
    interlock.check(reading);
    EXPECT_EQ(interlock.tripped(), Trip::uncommanded);
    EXPECT_EQ(shaker.stops, 1);
    // WHEN the stop is on its way, THEN the same reading is no new trip
    interlock.acknowledge(Trip::uncommanded);
    interlock.check(reading);
    EXPECT_EQ(interlock.tripped(), Trip::none);
}

}  // namespace
}  // namespace vibrig::rt
