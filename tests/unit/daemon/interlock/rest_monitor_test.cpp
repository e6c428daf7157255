#include "daemon/interlock/rest_monitor.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace vibrig::rt {
namespace {

using drivers::kMillisecond;
using drivers::kSecond;
using drivers::Quality;
using drivers::Time;

/// Feeds a monitor with samples at 40 Hz, platform and table as the test wants them.
struct RestMonitorTest : testing::Test {
    static constexpr Time kPeriod = 25 * kMillisecond;
    static constexpr double kCount_g = 3.8e-6;
    RestMonitor monitor{{}, kPeriod, {kCount_g, kCount_g, kCount_g, kCount_g}};
    Time now = 10 * kSecond;
    double platform_g = 0, table_g = 0;  ///< peak, at 15 Hz
    double tilt_deg_per_s = 0, noise_g = 1e-4;
    static constexpr unsigned kSeed = 1;
    std::mt19937_64 random{kSeed};
    bool force_valid = true, table_bound = true, table_valid = true;

    drivers::Sample sample() {
        std::normal_distribution<double> noise(0, noise_g);
        drivers::Sample s;
        s.time = now;
        const double phase = 2 * std::numbers::pi * 15 * drivers::to_seconds(now);
        const double tilt = tilt_deg_per_s * drivers::to_seconds(now) * std::numbers::pi / 180;
        const double up = 1 + platform_g * std::sin(phase);
        s.force = {up * std::sin(tilt) + noise(random), up * std::cos(tilt) + noise(random),
                   noise(random)};
        s.table_accel = table_g * std::cos(phase) + noise(random);
        s.quality.fill(Quality::good);
        if (!force_valid) s.quality[4] = Quality::flagged;
        if (!table_valid) s.quality[6] = Quality::stale;
        if (!table_bound) s.quality[6] = Quality::unbound;
        return s;
    }
    Rest run(double seconds) {
        for (const Time end = now + drivers::from_seconds(seconds); now < end;) {
            now += kPeriod;
            monitor.add(sample());
        }
        return monitor.rest(now);
    }
};

TEST_F(RestMonitorTest, NobodyCallsItRestBeforeAWindowOfSamples) {
    EXPECT_EQ(monitor.rest(now).platform.verdict, RestVerdict::unknown);
    EXPECT_FALSE(run(0.4).measured());
    EXPECT_TRUE(run(0.2).measured());
}

TEST_F(RestMonitorTest, ARateThatNobodyHasStatedIsRefused) {
    EXPECT_THROW(RestMonitor({}, 0, {}), std::invalid_argument);
    EXPECT_THROW(RestMonitor({}, -kPeriod, {}), std::invalid_argument);
}

TEST_F(RestMonitorTest, MeasuresTheRmsOfTheVibration) {
    // GIVEN 5 g at the table and two thirds of it on the platform
    table_g = 5;
    platform_g = 10.0 / 3;
    const Rest rest = run(2);
    // THEN the rms is 1/sqrt(2) of the peak; 20 samples of 7.5 periods leave 7 % at most
    EXPECT_EQ(rest.table.verdict, RestVerdict::moving);
    EXPECT_NEAR(rest.table.rms_g, 5 / std::numbers::sqrt2, 0.25);
    EXPECT_GT(rest.platform.rms_g, 1.0);  // the norm has no sign: above 1 g it folds over
    EXPECT_TRUE(rest.moving());
    EXPECT_FALSE(rest.measured());
}

TEST_F(RestMonitorTest, ALimitOfTwentyMilligTellsRestFromTheSmallestMotion) {
    table_g = platform_g = 0.9 * 0.02 * std::numbers::sqrt2;
    EXPECT_TRUE(run(2).measured());
    table_g = platform_g = 1.15 * 0.02 * std::numbers::sqrt2;
    const Rest rest = run(2);
    EXPECT_EQ(rest.platform.verdict, RestVerdict::moving);
    EXPECT_EQ(rest.table.verdict, RestVerdict::moving);
}

TEST_F(RestMonitorTest, ASlowTiltIsNoVibration) {
    // GIVEN a platform that turns by 30 deg/s: each axis moves by 0.25 g in a window
    tilt_deg_per_s = 30;
    EXPECT_TRUE(run(3).measured());
}

TEST_F(RestMonitorTest, NoiseOfASixthOfTheLimitIsRestInEveryWindow) {
    // 6 sigma: over 10 000 windows none is taken for motion
    noise_g = 0.02 / 6;
    run(1);
    for (int i = 0; i < 10'000; ++i)
        ASSERT_TRUE(run(0.025).measured()) << "sample " << i << ", seed " << kSeed;
}

TEST_F(RestMonitorTest, SilenceIsNotRest) {
    ASSERT_TRUE(run(1).measured());
    EXPECT_TRUE(monitor.rest(now + 150 * kMillisecond).measured());
    const Rest later = monitor.rest(now + 250 * kMillisecond);
    EXPECT_FALSE(later.measured());
    EXPECT_FALSE(later.moving()) << "nobody knows";
    EXPECT_EQ(later.platform.verdict, RestVerdict::unknown);
}

TEST_F(RestMonitorTest, InvalidAccelerometersAreNotRest) {
    ASSERT_TRUE(run(1).measured());
    force_valid = false;
    EXPECT_EQ(run(0.5).platform.verdict, RestVerdict::unknown);
    force_valid = true;
    EXPECT_TRUE(run(0.7).measured());
    table_valid = false;
    EXPECT_FALSE(run(0.5).measured());
}

TEST_F(RestMonitorTest, ATableWithoutAnAccelerometerIsNotAsked) {
    table_bound = false;
    const Rest rest = run(1);
    EXPECT_EQ(rest.table.verdict, RestVerdict::absent);
    EXPECT_TRUE(rest.measured());
    platform_g = 1;
    EXPECT_TRUE(run(0.2).moving());
}

TEST_F(RestMonitorTest, ALostSampleNowAndThenDelaysNothing) {
    for (int i = 0; i < 400; ++i) {
        force_valid = i % 5 != 0;
        const Rest rest = run(0.025);
        if (i > 40) {
            ASSERT_TRUE(rest.measured()) << "sample " << i;
        }
    }
}

TEST_F(RestMonitorTest, RestSinceAMomentRestsOnNothingBeforeIt) {
    ASSERT_TRUE(run(1).measured());
    const Time stopped = now;
    EXPECT_FALSE(run(0.4).measured_since(stopped));
    EXPECT_TRUE(run(0.2).measured_since(stopped));
}

struct DoubtedWitnessTest : RestMonitorTest {
    DoubtedWitnessTest() { table_bound = false; }
    /// Of an accelerometer along y that is stuck, or flickers by a count.
    Rest run_stuck(double seconds, double flicker_g = 0) {
        for (const Time end = now + drivers::from_seconds(seconds); now < end;) {
            now += kPeriod;
            drivers::Sample stuck = sample();
            stuck.force[1] = 1 + (now / kPeriod % 2 == 0 ? flicker_g : 0);
            monitor.add(stuck);
        }
        return monitor.rest(now);
    }
};

TEST_F(DoubtedWitnessTest, AnAccelerometerThatIsStuckDoesNotConfirmRest) {
    // GIVEN one along the vertical that sticks while the table shakes: the norm stands still
    platform_g = 3;
    ASSERT_TRUE(run(1).moving());
    ASSERT_TRUE(run_stuck(2).measured()) << "or this shows nothing";
    // WHEN the trip that it made says that it contradicts the command
    monitor.doubt(drivers::Channel::accel_y);
    // THEN its stillness is no rest, though it may flicker by a count
    for (const double flicker_g : {0.0, kCount_g}) {
        const Rest rest = run_stuck(20, flicker_g);
        EXPECT_EQ(rest.platform.verdict, RestVerdict::unknown);
        EXPECT_TRUE(rest.platform.doubted);
        EXPECT_FALSE(rest.measured());
    }
}

TEST_F(DoubtedWitnessTest, OneThatLivesIsBelievedByItsNoise) {
    run(1);
    monitor.doubt(drivers::Channel::accel_y);
    const Time doubted = now;
    EXPECT_FALSE(run(kPeriod * 1e-9).measured());
    const Rest rest = run(0.7);
    EXPECT_TRUE(rest.measured_since(doubted)) << "seed " << kSeed;
    EXPECT_FALSE(rest.platform.doubted);
}

TEST_F(DoubtedWitnessTest, OneThatMovesIsNeverUnknown) {
    platform_g = 1;
    run(1);
    monitor.doubt(drivers::Channel::accel_x);
    EXPECT_TRUE(run(0.025).moving());
}

TEST_F(DoubtedWitnessTest, OneThatComesBackHasToShowAWholeWindowOfRest) {
    run(1);
    monitor.doubt(drivers::Channel::accel_y);
    ASSERT_FALSE(run_stuck(3).measured());
    const Time back = now;
    EXPECT_FALSE(run(0.4).measured());
    EXPECT_TRUE(run(0.3).measured_since(back));
}

TEST_F(DoubtedWitnessTest, WhereAnotherIsThereThatOneAloneDecides) {
    // GIVEN a table with an accelerometer of its own, and the platform's stuck
    table_bound = true;
    run(1);
    monitor.doubt(drivers::Channel::accel_y);
    // THEN the table's says rest, and motion
    EXPECT_TRUE(run_stuck(1).measured());
    table_g = 1;
    Rest rest = run_stuck(1);
    EXPECT_TRUE(rest.moving());
    EXPECT_FALSE(rest.measured());
    // WHEN the table's is doubted, too, and sticks THEN nobody says rest
    table_g = noise_g = 0;
    monitor.doubt(drivers::Channel::table_accel);
    rest = run_stuck(3);
    EXPECT_TRUE(rest.table.doubted && rest.platform.doubted);
    EXPECT_FALSE(rest.measured());
    // WHEN the platform's lives again THEN it decides
    noise_g = 1e-4;
    table_valid = false;
    EXPECT_TRUE(run(1).measured());
}

struct LivenessTest : RestMonitorTest {
    /// All of them show their last values for ever.
    Rest run_frozen(double seconds) {
        const drivers::Sample last = sample();
        for (const Time end = now + drivers::from_seconds(seconds); now < end;) {
            now += kPeriod;
            drivers::Sample frozen = last;
            frozen.time = now;
            monitor.add(frozen);
        }
        return monitor.rest(now);
    }
};

TEST_F(LivenessTest, OneThatShowsItsLastValueForEverHasLostItsNoise) {
    // GIVEN accelerometers whose noise at rest has been seen for a quarter of a minute
    run(15);
    platform_g = table_g = 5;
    ASSERT_TRUE(run(2).moving());
    // WHEN they cease to say anything new while it shakes THEN that is no rest
    const Rest rest = run_frozen(20);
    EXPECT_EQ(rest.platform.verdict, RestVerdict::unknown);
    EXPECT_EQ(rest.table.verdict, RestVerdict::unknown);
    EXPECT_TRUE(rest.platform.doubted && rest.table.doubted);
    EXPECT_FALSE(rest.measured());
    // and at no moment of it was it one
    platform_g = table_g = 5;
    run(2);
    for (int n = 0; n < 100; ++n) ASSERT_FALSE(run_frozen(0.025).measured()) << n;
    // WHEN they live again THEN rest is measured
    platform_g = table_g = 0;
    EXPECT_TRUE(run(1).measured());
}

TEST_F(LivenessTest, OfOneWithoutNoiseThatCannotBeTold) {
    // GIVEN less than half a count of noise, however long that was at rest, and slews between
    noise_g = 0.3 * kCount_g;
    tilt_deg_per_s = 10;
    run(30);
    tilt_deg_per_s = 0;
    run(60);
    platform_g = table_g = 5;
    run(2);
    platform_g = table_g = 0;
    EXPECT_EQ(run(2).platform.verdict, RestVerdict::still);
    EXPECT_TRUE(run(2).measured());
    EXPECT_TRUE(run_frozen(2).measured());
}

TEST_F(LivenessTest, NoiseThatBecomesLessIsForgotten) {
    // GIVEN a room that is loud by day, and quiet by night
    noise_g = 20 * kCount_g;
    run(30);
    noise_g = kCount_g;
    run(5);
    noise_g = 0;
    EXPECT_TRUE(run(2).measured());
}

TEST_F(LivenessTest, NoiseOfThreeCountsIsNeverLost) {
    noise_g = 3 * kCount_g;
    run(30);
    for (int n = 0; n < 40'000; ++n) ASSERT_TRUE(run(0.025).measured()) << "seed " << kSeed;
}

TEST_F(RestMonitorTest, AtAKilohertzMotionIsSeenAsSoon) {
    // GIVEN 1 kHz, where not each sample sums the window up anew
    RestMonitor fast({}, drivers::kMillisecond);
    const auto feed = [&](double seconds) {
        for (const Time end = now + drivers::from_seconds(seconds); now < end;) {
            now += drivers::kMillisecond;
            fast.add(sample());
        }
    };
    feed(0.6);
    ASSERT_TRUE(fast.rest(now).measured());
    // WHEN it begins to shake THEN that is seen within 25 ms: of 1 g at 15 Hz a quarter of a period
    table_g = platform_g = 1;
    feed(0.025);
    EXPECT_TRUE(fast.rest(now).moving());
    table_g = platform_g = 0;
    feed(0.49);
    EXPECT_FALSE(fast.rest(now).measured());
    feed(0.03);
    EXPECT_TRUE(fast.rest(now).measured());
    EXPECT_LE(now - fast.rest(now).platform.to, 5 * drivers::kMillisecond);
}

TEST_F(RestMonitorTest, SlowSamplesGetAWindowOfEight) {
    RestMonitor slow({}, kSecond);
    for (int i = 0; i < 8; ++i) {
        now += kSecond;
        slow.add(sample());
    }
    EXPECT_TRUE(slow.rest(now + 2 * kSecond).measured());
}

}  // namespace
}  // namespace vibrig::rt
