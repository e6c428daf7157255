#include "daemon/guard/motion.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <random>

namespace vibrig::guard {
namespace {

constexpr double kRate_hz = 40, kWindow_s = 0.5;
using Force = std::function<std::array<double, 3>(double)>;

Motion after(double seconds, std::size_t axes, const Force& force) {
    MotionWindow window(kWindow_s, axes);
    double t = 0;
    for (; t < seconds; t += 1 / kRate_hz) window.add(t, force(t));
    return window.at(t);
}

double sine(double amplitude, double frequency_hz, double t) {
    return amplitude * std::sin(2 * std::numbers::pi * frequency_hz * t + 0.3);
}

TEST(Motion, OfASineIsItsPeak) {
    // 7.5 periods in the window: half a period more or less is 1 / (2 pi 7.5) of the square, 2 %;
    // the straight line takes as much again.
    for (const double peak : {0.1, 0.5, 5.0, 12.0}) {
        const auto motion = after(3, 1, [&](double t) {
            return std::array{sine(peak, 15, t), 0.0, 0.0};
        });
        ASSERT_TRUE(motion.known);
        EXPECT_NEAR(motion.peak_g, peak, 0.05 * peak);
        EXPECT_NEAR(motion.rest_g, peak / std::numbers::sqrt2, 0.05 * peak);
    }
}

TEST(Motion, OfAPlatformIsThatOfItsVectorWhicheverWayItHangs) {
    for (const double gamma : {0.0, 0.7, 1.5}) {
        const auto motion = after(3, 3, [&](double t) {
            const double f = 1 + sine(6, 15, t);  // along gravity, over 1 g: the norm folds
            return std::array{f * std::cos(gamma), f * std::sin(gamma), 0.0};
        });
        EXPECT_NEAR(motion.peak_g, 6, 0.3);
        EXPECT_GT(motion.rest_g, 0.3) << "folded it is no less motion";
    }
}

TEST(Motion, OfNoiseAtRestIsItsSigma) {
    for (unsigned seed = 1; seed <= 20; ++seed) {
        SCOPED_TRACE(seed);
        std::mt19937 random(seed);
        std::normal_distribution<double> noise(0, 1e-3);
        const auto motion = after(3, 3, [&](double) {
            return std::array{noise(random), 1 + noise(random), noise(random)};
        });
        // 20 samples of the norm: sigma within 1 +- 5 / sqrt(40)
        EXPECT_NEAR(motion.rest_g, 1e-3, 0.8e-3);
        EXPECT_LT(motion.peak_g, 5e-3);
    }
}

TEST(Motion, ASlewTurnsGravityAndIsNone) {
    // 60 deg/s about a level axis
    const auto motion = after(3, 3, [](double t) {
        const double angle = std::numbers::pi / 3 * t;
        return std::array{std::sin(angle), std::cos(angle), 0.0};
    });
    EXPECT_LT(motion.rest_g, 1e-9);
    EXPECT_LT(motion.peak_g, 0.05);  // the curve that a straight line leaves: 0.5236^2 / 8 * 0.6
}

TEST(Motion, IsUnknownUntilTheWindowIsFullAndWhenItGrowsOld) {
    MotionWindow window(kWindow_s, 1);
    EXPECT_FALSE(window.at(0).known);
    for (int i = 0; i < 14; ++i) window.add(i / kRate_hz, {0, 0, 0});
    EXPECT_FALSE(window.at(14 / kRate_hz).known);
    for (int i = 14; i < 40; ++i) window.add(i / kRate_hz, {0, 0, 0});
    EXPECT_TRUE(window.at(1).known);
    EXPECT_TRUE(window.at(1.2).known);
    EXPECT_FALSE(window.at(1.3).known);
}

TEST(Motion, WhatIsNoNumberIsLeftOutAndTimeThatGoesBackBeginsAnew) {
    MotionWindow window(kWindow_s, 1);
    for (int i = 0; i < 40; ++i)
        window.add(i / kRate_hz,
                   {i % 2 == 0 ? std::numeric_limits<double>::quiet_NaN() : 0.0, 0, 0});
    const auto motion = window.at(1);
    EXPECT_TRUE(motion.known);
    EXPECT_EQ(motion.rest_g, 0);
    window.add(0.2, {0, 0, 0});
    EXPECT_FALSE(window.at(0.2).known);
}

TEST(Motion, StampsThatComeInBunchesAreStillMotion) {
    // A busy machine: four samples at a time get the stamp of the last.
    MotionWindow window(kWindow_s, 1);
    double bunch = 0;
    for (int i = 0; i < 80; ++i) {
        if (i % 4 == 0) bunch = (i + 3) / kRate_hz;
        window.add(bunch, {sine(5, 15, i / kRate_hz), 0, 0});
    }
    const auto motion = window.at(bunch);
    ASSERT_TRUE(motion.known);
    EXPECT_NEAR(motion.peak_g, 5, 0.8);
}

}  // namespace
}  // namespace vibrig::guard
