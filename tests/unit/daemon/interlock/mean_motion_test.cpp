#include "daemon/interlock/mean_motion.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "daemon/rt/rate_meter.hpp"

namespace vibrig::rt {
namespace {

using drivers::kSecond;
using drivers::Time;

drivers::Sample sample_at(Time time, std::uint32_t sequence) {
    drivers::Sample sample;
    sample.quality.fill(drivers::Quality::good);
    sample.time = time;
    sample.sequence = sequence;
    return sample;
}

TEST(MeanMotion, TakesTheVibrationOutOfASecondThatIsNoWholeNumberOfPeriods) {
    for (const double hz : {15.0, 15.37, 13.33, 18.9, 23.1}) {
        MeanMotionMeter meter(hz);
        meter.begin(true);
        int seconds = 0;
        for (std::uint32_t n = 0; n < 400; ++n) {
            const Time time = kSecond + n * 25 * drivers::kMillisecond;
            auto sample = sample_at(time, n);
            const double a =
                6 * std::sin(2 * std::numbers::pi * std::fmod(hz * drivers::to_seconds(time), 1));
            // along a vertical and, a fifth of it, across
            sample.force = {0.2 * a, 0.6 * (1 + a), 0.8 * (1 + a)};
            sample.angle = {n % 2 == 0 ? 1e-4 : 2 * std::numbers::pi - 1e-4, 1, 2};
            if (!meter.add(sample)) continue;
            ++seconds;
            ASSERT_TRUE(meter.mean().good);
            EXPECT_NEAR(meter.mean().force[0], 0, 1e-9) << hz;
            EXPECT_NEAR(meter.mean().force[1], 0.6, 1e-9) << hz;
            EXPECT_NEAR(meter.mean().force[2], 0.8, 1e-9) << hz;
            EXPECT_NEAR(std::hypot(meter.mean().cosine[0], meter.mean().sine[0]), 1.2, 1e-9) << hz;
            EXPECT_NEAR(std::hypot(meter.mean().cosine[2], meter.mean().sine[2]), 4.8, 1e-9) << hz;
            EXPECT_NEAR(std::remainder(meter.mean().angle[0], 2 * std::numbers::pi), 0, 1e-9);
            EXPECT_GE(meter.mean().to - meter.mean().from, kSecond);
        }
        EXPECT_GE(seconds, 8);
    }
}

TEST(MeanMotion, ASecondInWhichTheGimbalsMoveOrMostIsMissingIsNotGood) {
    MeanMotionMeter meter(15);
    for (std::uint32_t n = 0; n < 240; ++n) {
        auto sample = sample_at(kSecond + n * 25 * drivers::kMillisecond, n);
        sample.force = {0, 1, 0};
        const auto second = n / 40;
        if (second == 1) sample.angle[0] = 0.001 * (n - 40);
        if (second == 3 && n % 3 != 0) sample.quality[4] = drivers::Quality::flagged;
        if (!meter.add(sample)) continue;
        EXPECT_EQ(meter.mean().good, second - 1 != 1 && second - 1 != 3) << second - 1;
    }
}

TEST(RateMeter, MeasuresWhatComesAndBeginsAnewAfterABreak) {
    for (const double rate : {40.0, 40.5, 80.0, 1000.0}) {
        RateMeter meter;
        Time time = kSecond;
        std::uint32_t n = 0;
        for (; drivers::to_seconds(time) < 1.45; time += drivers::from_seconds(1 / rate))
            meter.add(sample_at(time, n++));
        EXPECT_EQ(meter.hz(), 0) << "less than half a second is nothing to go by";
        for (; time < 30 * kSecond; time += drivers::from_seconds(1 / rate))
            // one in a hundred is lost: the count tells
            if (++n % 100 != 0) meter.add(sample_at(time, n));
        EXPECT_NEAR(meter.hz() / rate, 1, 1e-3);
        EXPECT_NEAR(meter.span_s(), 10, 1.1);
        meter.add(sample_at(time + 5 * kSecond, n + 7));
        EXPECT_EQ(meter.hz(), 0);
    }
}

}  // namespace
}  // namespace vibrig::rt
