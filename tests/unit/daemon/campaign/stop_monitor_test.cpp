#include "daemon/campaign/stop_monitor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/unit/daemon/campaign/fake_accelerometers.hpp"
#include "tests/unit/daemon/interlock/fake_shaker.hpp"

namespace vibrig::campaign {
namespace {

using drivers::kMillisecond;
using drivers::kSecond;
using drivers::Time;
using News = StopMonitor::News;

struct StopMonitorTest : testing::Test {
    FakeShaker shaker;
    FakeAccelerometers accelerometers;
    StopSettings settings;
    StopMonitor monitor{shaker, [this](Time at) { return accelerometers.monitor.rest(at); }, {}};
    Time now = 10 * kSecond;
    bool obeys = true;
    bool handled = false;  ///< gimbals move

    StopMonitorTest() {
        shaker.now.valid = true;
        run(1);
    }
    void shake(double table_g) {
        monitor.excited(table_g);
        shaker.requests.push_back({15, table_g, 1});
        run(1);
    }
    /// Until there is news, or so long; how long it took.
    double run(double seconds, News* news = nullptr) {
        const Time began = now;
        while (now - began < drivers::from_seconds(seconds)) {
            now += 50 * kMillisecond;
            if (obeys) shaker.obey(now);
            shaker.now.time = now;
            accelerometers.run_to(now, shaker.now.measured_g);
            const auto found = monitor.update(now, handled);
            if (news != nullptr && found != News::none) {
                *news = found;
                break;
            }
        }
        return drivers::to_seconds(now - began);
    }
};

TEST_F(StopMonitorTest, AStopIsDoneAfterAWindowOfRest) {
    shake(5);
    shaker.stop_now();
    EXPECT_TRUE(monitor.stopping());
    auto news = News::none;
    const double took_s = run(3, &news);
    EXPECT_EQ(news, News::confirmed);
    EXPECT_GE(took_s, 0.5);
    EXPECT_LE(took_s, 0.8);
    EXPECT_FALSE(monitor.stopping());
    EXPECT_FALSE(monitor.excited());
}

TEST_F(StopMonitorTest, AControllerThatReadsZeroProvesNothing) {
    shake(5);
    accelerometers.table_g = 5;
    shaker.stop_now();
    auto news = News::none;
    const double took_s = run(10, &news);
    EXPECT_EQ(news, News::disobeyed);
    EXPECT_NEAR(took_s, 3, 0.15);
    EXPECT_TRUE(monitor.stopping());
    EXPECT_TRUE(monitor.unsettled(now));
    news = News::none;
    run(5, &news);
    EXPECT_EQ(news, News::none) << "reported once";
}

TEST_F(StopMonitorTest, ATableThatMovesUncommandedIsReportedWhateverTheControllerReads) {
    // GIVEN a stop that was confirmed, and a contactor that closes by itself afterwards
    shake(5);
    shaker.stop_now();
    auto news = News::none;
    run(5, &news);
    ASSERT_EQ(news, News::confirmed);
    accelerometers.table_g = 1;
    news = News::none;
    const double took_s = run(10, &news);
    EXPECT_EQ(news, News::uncommanded);
    EXPECT_LE(took_s, safety::kUnarmedMotion_s + 0.6) << "the window of rest and a second";
    // THEN it is reported once, and again when it comes again
    news = News::none;
    run(5, &news);
    EXPECT_EQ(news, News::none);
    accelerometers.table_g = 0;
    run(2);
    accelerometers.table_g = 1;
    run(5, &news);
    EXPECT_EQ(news, News::uncommanded);
}

TEST_F(StopMonitorTest, WhatIsCommandedOrABlowOfAMomentIsNotUncommanded) {
    auto news = News::none;
    shake(5);
    run(5, &news);
    EXPECT_EQ(news, News::none);
    shaker.stop_now();
    run(5, &news);
    ASSERT_EQ(news, News::confirmed);
    news = News::none;
    accelerometers.table_g = 1;
    run(0.3, &news);  // and half a second more in the window of rest
    accelerometers.table_g = 0;
    run(5, &news);
    EXPECT_EQ(news, News::none);
}

TEST_F(StopMonitorTest, AHandOnThePlatformIsNotUncommandedWhereTheTableIsSeenStill) {
    auto news = News::none;
    accelerometers.platform_g = 1;
    accelerometers.table_g = 0;
    run(5, &news);
    EXPECT_EQ(news, News::none);
    // WHEN the table's accelerometer falls silent THEN the platform's speaks for it
    accelerometers.table_good = false;
    run(5, &news);
    EXPECT_EQ(news, News::uncommanded);
}

TEST_F(StopMonitorTest, WhileGimbalsMoveThePlatformStillTellsOfATableThatShakes) {
    // GIVEN a rig without an accelerometer on the table, and a slew of a minute
    accelerometers.table_bound = false;
    handled = true;
    run(1);
    // WHEN the table below it begins by itself
    accelerometers.table_g = 4.9;
    auto news = News::none;
    const double took_s = run(40, &news);
    EXPECT_EQ(news, News::uncommanded);
    EXPECT_LE(took_s, safety::kUnarmedMotion_s + 0.5);
    EXPECT_THAT(monitor.what_moves(now), testing::HasSubstr("platform 1."));
}

TEST_F(StopMonitorTest, WhatASlewMakesOfThePlatformIsNoTable) {
    // GIVEN a rig without an accelerometer on the table
    accelerometers.table_bound = false;
    handled = true;
    accelerometers.platform_g = 0.19 * std::numbers::sqrt2;
    auto news = News::none;
    run(60, &news);
    EXPECT_EQ(news, News::none);
    // BUT where no gimbal moves it is motion
    handled = false;
    run(5, &news);
    EXPECT_EQ(news, News::uncommanded);
}

/// More than any rig's slews do, by far: 30 deg/s, an axis that counts double, 0.1 m from the axis.
TEST(SlewsWithoutAWitnessOnTheTable, StayBelowWhatIsTakenForATable) {
    FakeShaker shaker;
    shaker.now.valid = true;
    rt::RestMonitor rest({}, 25 * kMillisecond);
    StopMonitor monitor(shaker, [&](Time at) { return rest.rest(at); }, {});
    const double rate = 30 * std::numbers::pi / 180, centripetal_g = rate * rate * 0.1 / 9.81;
    double highest_g = 0;
    for (int k = 1; k < 40 * 24; ++k) {
        drivers::Sample sample;
        sample.time = k * 25 * kMillisecond;
        const double angle = rate * drivers::to_seconds(sample.time);
        sample.force = {2 * std::sin(angle) + 0.05, std::cos(angle) + centripetal_g, 0.05};
        sample.quality.fill(drivers::Quality::good);
        sample.quality[static_cast<std::size_t>(drivers::Channel::table_accel)] =
            drivers::Quality::unbound;
        rest.add(sample);
        highest_g = std::max(highest_g, rest.rest(sample.time).platform.rms_g);
        EXPECT_EQ(monitor.update(sample.time, true), News::none) << angle;
    }
    EXPECT_GT(highest_g, safety::kMoving_g) << "or this shows nothing";
    EXPECT_LT(highest_g, 0.1);
}

TEST_F(StopMonitorTest, APlatformHasTheTimeOfItsPadsBeforeItDisobeys) {
    // GIVEN a table that stops, and a platform that does not come to rest on its pads
    shake(5);
    accelerometers.platform_g = 1;
    shaker.stop_now();
    auto news = News::none;
    const double took_s = run(30, &news);
    EXPECT_EQ(news, News::disobeyed);
    EXPECT_GT(monitor.longest_s(5), settings.deadline_s + 0.5) << "or this shows nothing";
    EXPECT_NEAR(took_s, monitor.longest_s(5), 0.15);
}

TEST_F(StopMonitorTest, NorDoAccelerometersThatAreSilent) {
    shake(5);
    accelerometers.silent = true;
    shaker.stop_now();
    auto news = News::none;
    EXPECT_NEAR(run(10, &news), 3, 0.15);
    EXPECT_EQ(news, News::disobeyed);
    EXPECT_NE(monitor.what_moves(now).find("no good accelerometer on the table"),
              std::string::npos);
}

TEST_F(StopMonitorTest, AWitnessThatIsDoubtedConfirmsNothingAlone) {
    // GIVEN a rig without an accelerometer on the table, the platform's stuck while it shakes, and
    // a controller that says that it has stopped
    accelerometers.table_bound = false;
    shake(5);
    accelerometers.platform_g = 0;
    accelerometers.monitor.doubt(drivers::Channel::accel_y);
    shaker.stop_now();
    auto news = News::none;
    // THEN that is no rest, and said when the platform's time is over
    const double took_s = run(30, &news);
    EXPECT_EQ(news, News::disobeyed);
    EXPECT_NEAR(took_s, monitor.longest_s(5), 0.15);
    EXPECT_NE(monitor.what_moves(now).find("accelerometer on the platform is doubted"),
              std::string::npos)
        << monitor.what_moves(now);
}

TEST_F(StopMonitorTest, BesideATableThatIsSeenToRestADoubtedPlatformIsNoDisobedience) {
    shake(5);
    accelerometers.platform_g = 0;
    accelerometers.monitor.doubt(drivers::Channel::accel_y);
    shaker.stop_now();
    auto news = News::none;
    EXPECT_LE(run(30, &news), 0.8);
    EXPECT_EQ(news, News::confirmed);
}

TEST_F(StopMonitorTest, ARigThatIsSwitchedOffIsNoAlarmAtTheStart) {
    // GIVEN a rig that nothing has excited in this life, and that tells nothing
    accelerometers.silent = true;
    shaker.now.valid = false;
    obeys = false;
    run(1);
    shaker.stop_now();
    auto news = News::none;
    run(20, &news);
    // THEN it is neither at rest nor disobedient, and may be left alone
    EXPECT_EQ(news, News::none);
    EXPECT_TRUE(monitor.stopping());
    EXPECT_FALSE(monitor.unsettled(now));
}

TEST_F(StopMonitorTest, ATableThatAnEarlierLifeLeftShakingIsOne) {
    accelerometers.table_g = 1;
    shaker.stop_now();
    auto news = News::none;
    EXPECT_NEAR(run(20, &news), 3, 0.15);
    EXPECT_EQ(news, News::disobeyed);
}

TEST_F(StopMonitorTest, AHandOnAPlatformThatNothingHasExcitedIsNone) {
    accelerometers.table_g = 0.04 * std::numbers::sqrt2;  // between rest and motion
    shaker.stop_now();
    auto news = News::none;
    run(20, &news);
    EXPECT_EQ(news, News::none);
    EXPECT_TRUE(monitor.stopping());
}

TEST_F(StopMonitorTest, AControllerThatReadsOnIsDisobedient) {
    shake(5);
    obeys = false;
    shaker.stop_waits = false;
    shaker.stop_now();
    shaker.stop_waits = false;  // acknowledged, read back as 0
    shaker.now.running = false;
    auto news = News::none;
    EXPECT_NEAR(run(20, &news), 3, 0.15);
    EXPECT_EQ(news, News::disobeyed);
}

TEST_F(StopMonitorTest, AStopThatComesWhileAnotherIsAwaitedKeepsTheFirstOnesTime) {
    shake(5);
    accelerometers.table_g = 5;
    shaker.stop_now();
    run(2);
    shaker.stop_now();
    auto news = News::none;
    EXPECT_NEAR(run(10, &news), 1, 0.15);
    EXPECT_EQ(news, News::disobeyed);
}

TEST(PadRingDown, IsAnAllowanceUntilItIsMeasuredAndThenLogarithmicInTheLevel) {
    EXPECT_EQ(PadRingDown{}.from_s(9), safety::kRingDown_s);
    // 0.5 g take 0.8 s at 3 / s: twenty times as much ln(20) / 3 = 1 s longer
    const PadRingDown measured{0.5, 0.8, 3};
    EXPECT_NEAR(measured.from_s(10), 0.8 + std::log(20) / 3, 1e-12);
    EXPECT_EQ(measured.from_s(0.5), 0.8);
    EXPECT_EQ(measured.from_s(0.1), 0.8) << "never shorter than it was seen to be";
}

}  // namespace
}  // namespace vibrig::campaign
