#include "estimator/level/harmonics.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace vibrig::estimator {
namespace {

/// So much of the fundamental's amplitude at 2 f .. 5 f, with phases of their own.
Harmonics::Shares reported(double hz, double rate_hz, const std::array<double, 4>& relative,
                           double off_hz = 0, double seconds = 20, double gap_from_s = 1e9) {
    constexpr double kNoise = 1e-4;
    std::mt19937_64 random(5);
    std::normal_distribution<double> noise(0, kNoise);
    Harmonics harmonics;
    harmonics.begin(hz, 0);
    for (int i = 0; i < static_cast<int>(seconds * rate_hz); ++i) {
        const double t = i / rate_hz;
        if (t > gap_from_s && t < gap_from_s + 0.3) continue;
        const double phase = 2 * std::numbers::pi * (hz + off_hz) * t;
        double force = 1 + 6 * std::cos(phase) + noise(random);
        for (std::size_t k = 0; k < 4; ++k)
            force += 6 * relative[k] *
                     std::cos(static_cast<double>(k + 2) * phase + 0.7 * static_cast<double>(k));
        harmonics.add(t, force);
    }
    return harmonics.shares(1 / rate_hz);
}

TEST(HarmonicsTest, SharesAreSquaresOfTheAmplitudes) {
    const std::array<double, 4> relative{0.05, 0.03, 0.02, 0.02};
    double all = 1;
    for (const double one : relative) all += one * one;
    for (const double rate : {400.0, 1000.0}) {
        const auto shares = reported(30.1, rate, relative);
        for (std::size_t k = 0; k < 4; ++k)
            EXPECT_NEAR(shares[k], relative[k] * relative[k] / all, 2e-6) << k << " at " << rate;
    }
}

TEST(HarmonicsTest, AFrequencyOffItsCommandAndGapsMatterLittle) {
    const std::array<double, 4> relative{0.05, 0, 0, 0};
    // A main lobe of 2 Hz either side falls by 1 % at 0.05 Hz, by 4 % at twice that.
    EXPECT_NEAR(reported(30.1, 400, relative, 0.05)[0], 0.0025, 0.05 * 0.0025);
    EXPECT_NEAR(reported(30.1, 400, relative, 0, 20, 7.3)[0], 0.0025, 1e-5);
    EXPECT_EQ(reported(30.1, 400, relative, 0, 20, 7.3)[2], 0);
}

TEST(HarmonicsTest, WhatTheSamplingRateDoesNotShowIsNotReported) {
    const std::array<double, 4> relative{0.05, 0.05, 0.05, 0.05};
    EXPECT_EQ(reported(15, 40, relative), Harmonics::Shares{});
    const auto at_100 = reported(15.1, 100, relative);  // 2 f and no more lies below 45 Hz
    EXPECT_GT(at_100[0], 0.002);
    EXPECT_EQ(at_100[1], 0);
    EXPECT_EQ(reported(30.1, 400, {}), Harmonics::Shares{});
    EXPECT_EQ(Harmonics().shares(0.01), Harmonics::Shares{});
}

}  // namespace
}  // namespace vibrig::estimator
