#include "daemon/campaign/loop_check.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace vibrig::campaign {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// Five seconds of a table and of the platform over it at 40/s, upright.
/// `second`: harmonic of the platform, `across`: the vertical, both of the motion along it.
void shake(LoopCheck& loop, double hz, double table_g, double platform_g, double second = 0,
           double across = 0) {
    loop.measure();
    for (int i = 0; i < 200; ++i) {
        const double t = i / 40.0, wave = std::sin(2 * std::numbers::pi * hz * t);
        rt::Motion motion;
        motion.time = drivers::from_seconds(100 + t);
        const double twice = std::sin(4 * std::numbers::pi * hz * t);
        motion.force = {across * platform_g * wave, 1 + platform_g * (wave + second * twice), 0};
        motion.table = table_g * wave;
        motion.table_good = motion.good = true;
        loop.add(motion);
    }
}

Settings survey() {
    Settings settings;
    settings.frequency_hz = settings.rig.frequency_hz = 15;
    settings.rig.transmission = 1;
    for (const double hz : {15.0, 65.1, 0.0, 25.1, 65.1}) {
        Stop stop{{}, hz > 0 ? 6.0 : 0.0, hz};
        stop.transmission = hz > 20 ? 1 : 0;
        settings.stops.push_back(stop);
    }
    return settings;
}

TEST(LoopCheck, FurtherFrequenciesOfAPlanAreLookedAtOnceEach) {
    std::vector<double> hz;
    for (const Stop& stop : LoopCheck::further_frequencies(survey()))
        hz.push_back(stop.frequency_hz);
    EXPECT_THAT(hz, ElementsAre(25.1, 65.1));
    EXPECT_TRUE(LoopCheck::further_frequencies(Settings{}).empty());
}

// Of a mass on a spring without damping T = 1 / (x - 1), x = (f/fn)^2: 2/3 is x = 2.5, at 16
// instead of 15 Hz x = 2.8444. With half of the critical damping the roots are those of 4/9 x^2 -
// 13/9 x - 5/9 = 0.
TEST(LoopCheck, PadsAnswerAnotherFrequencyByTheirLaw) {
    const auto [low, high] = isolator_ratio(2.0 / 3, 15, 16);
    EXPECT_NEAR(low, 1.5 / (2.5 * 256 / 225 - 1), 1e-9);
    const double x = (13.0 / 9 + std::sqrt(169.0 / 81 + 80.0 / 81)) / (8.0 / 9) * 256 / 225;
    EXPECT_NEAR(high, 1.5 * std::sqrt((1 + x) / ((1 - x) * (1 - x) + x)), 1e-9);
    EXPECT_LT(high * 1.05, 1) << "a table that keeps its frequency is distinguished from it";
    EXPECT_EQ(isolator_ratio(1, 15, 16), (std::array<double, 2>{1, 1}));
}

TEST(LoopCheck, AHumAtRestIsNoSwingOfThePads) {
    constexpr double kHum_g = 4e-3, kHum_hz = 12.3, kNoise_g = 1e-4;  // within rest_g / 6
    constexpr double kSwing_hz = 5.3, kRate_per_s = 0.8, kPeriod_s = 0.025;
    for (unsigned seed = 1; seed <= 20; ++seed) {
        std::mt19937 engine(seed);
        std::normal_distribution<double> noise(0, kNoise_g);
        Settings settings = survey();
        settings.rig.accelerometer_g = kNoise_g;
        LoopCheck loop(settings.loop, settings.rig);
        double now_s = 100;
        const auto pass = [&](double seconds, double swing_g) {
            loop.measure();
            const double from_s = now_s;
            for (; now_s < from_s + seconds; now_s += kPeriod_s) {
                rt::Motion motion;
                motion.time = drivers::from_seconds(now_s);
                const double since = now_s - from_s;
                const double swing = swing_g * std::exp(-kRate_per_s * since) *
                                     std::sin(2 * std::numbers::pi * kSwing_hz * since);
                const double hum = kHum_g * std::sin(2 * std::numbers::pi * kHum_hz * now_s);
                motion.force = {0, 1 + hum + swing + noise(engine), 0};
                motion.good = true;
                loop.add(motion);
            }
        };
        // GIVEN a blower that hums at rest
        pass(2, 0);
        loop.rests();
        // THEN a platform that is bolted hard to its table does not swing after a stop
        pass(1.5, 0);
        EXPECT_EQ(loop.ring_down_since(0).rate_per_s, 0) << "seed " << seed;
        // AND one on pads does at its own rate. By the normal equations the hum, 4.7e-4 of the
        // swing's power, takes 3.65 times as much off exp(-2 rate T), which is 0.036 per s of the
        // rate; a record as short as this up to as much again
        pass(1.5, 0.3);
        EXPECT_NEAR(loop.ring_down_since(0).rate_per_s, kRate_per_s, 2 * 0.036) << "seed " << seed;
    }
}

TEST(LoopCheck, LimitsHoldAtEveryFrequency) {
    Settings settings = survey();
    EXPECT_EQ(LoopCheck::beyond_limits(settings), "");
    settings.stops.front().frequency_hz = 2;
    // 0.5 g at 2 Hz: 31 mm.
    EXPECT_THAT(LoopCheck::beyond_limits(settings), HasSubstr("at 2 Hz: 12 mm at most"));
}

TEST(LoopCheck, AFrequencyThatIsNotShownIsOutOfBand) {
    const Settings settings = survey();
    const double g = settings.loop.table_g;
    for (const bool ignored : {false, true}) {
        LoopCheck loop(settings.loop, settings.rig);
        loop.begin("Ada");
        shake(loop, ignored ? 15 : 25.1, g, g);
        const auto found = loop.finish_at(25.1, 1);
        EXPECT_NEAR(found.transmission, 1, 1e-3);
        shake(loop, 15, g, g);
        loop.finish(g);
        if (ignored) {
            EXPECT_THAT(loop.out_of_band(), HasSubstr("at 25.1 Hz frequency"));
            EXPECT_THAT(loop.refusal(), HasSubstr("out of band"));
        } else {
            EXPECT_THAT(loop.out_of_band(), ::testing::Not(HasSubstr("25.1 Hz")));
        }
    }
}

TEST(LoopCheck, DistortionOrMotionAcrossAtAFurtherFrequencyKeepsACampaignFromBeingArmed) {
    const Settings settings = survey();
    for (const double across : {0.0, 0.15}) {
        const double second = across > 0 ? 0 : 0.07;
        LoopCheck loop(settings.loop, settings.rig);
        loop.begin("Ada");
        shake(loop, 25.1, 0.5, 0.5, second, across);
        const auto found = loop.finish_at(25.1, 1);
        EXPECT_NEAR(found.in_step.cross_share, across, 1e-3);
        EXPECT_NEAR(found.in_step.distortion, second, 1e-3);
        shake(loop, 15, 0.5, 0.5);
        loop.finish(0.5);
        EXPECT_THAT(loop.refusal(), HasSubstr(across > 0 ? "at 25.1 Hz cross-axis share"
                                                         : "at 25.1 Hz distortion"));
        // AND the reference frequency, which was well, does not make it good
        EXPECT_THAT(loop.refusal(), ::testing::Not(HasSubstr("; distortion")));
    }
}

TEST(LoopCheck, MotionInStepIsARowAtEachFrequency) {
    const Settings settings = survey();
    LoopCheck loop(settings.loop, settings.rig);
    loop.begin("Ada");
    shake(loop, 25.1, 0.5, 0.5);
    const auto found = loop.finish_at(25.1, 1);
    shake(loop, 15, 0.5, 0.5);
    loop.finish(0.5);
    const auto named = [](const auto& rows) {
        return std::ranges::count(rows, std::string("motion in step"),
                                  [](const auto& row) { return std::string(row.name); });
    };
    EXPECT_EQ(named(found.rows), 1);
    EXPECT_EQ(named(loop.status().rows), 1);
    EXPECT_GT(loop.in_step().platform_g, 0.49);
    EXPECT_EQ(loop.in_step().motion_arcsec_g, 0);
}

TEST(LoopCheck, ATransmissionThatIsNotTheConfiguredOneIsOutOfBand) {
    const Settings settings = survey();
    LoopCheck loop(settings.loop, settings.rig);
    loop.begin("Ada");
    shake(loop, 65.1, 0.5, 0.4);
    EXPECT_NEAR(loop.finish_at(65.1, 1).transmission, 0.8, 1e-3);
    shake(loop, 15, 0.5, 0.5);
    loop.finish(0.5);
    EXPECT_THAT(loop.out_of_band(), HasSubstr("at 65.1 Hz transmission 0.8"));
    // Another check begins anew.
    loop.begin("Ada");
    shake(loop, 15, 0.5, 0.5);
    loop.finish(0.5);
    EXPECT_THAT(loop.out_of_band(), ::testing::Not(HasSubstr("65.1 Hz")));
}

}  // namespace
}  // namespace vibrig::campaign
