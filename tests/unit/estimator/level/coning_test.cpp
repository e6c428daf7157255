#include "estimator/level/coning.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace vibrig::estimator {
namespace {

/// A body that turns by a about x and, a quarter period later, by a about y goes around a cone: its
/// z turns by half of the product of angle and rate for every radian of time.
TEST(Coning, BoundIsTheRateOfAConeOverThePower) {
    constexpr double kHz = 65, kArcsec = 2, kPeak = 0.73;
    const double angle = kArcsec / 3600 * std::numbers::pi / 180, w = 2 * std::numbers::pi * kHz;
    // Integral of (x dy - y dx) / 2 over a period, by hand.
    double area = 0;
    constexpr int kSteps = 10000;
    for (int i = 0; i < kSteps; ++i) {
        const double a = 2 * std::numbers::pi * i / kSteps,
                     b = 2 * std::numbers::pi * (i + 1) / kSteps;
        area += angle * angle * (std::cos(a) * std::sin(b) - std::sin(a) * std::cos(b)) / 2;
    }
    const double rate = area * w / (2 * std::numbers::pi);  // rad/s
    const double deg_per_h = rate * 3600 * 180 / std::numbers::pi;
    EXPECT_NEAR(coning_bound(kHz, kArcsec, kPeak * kPeak), deg_per_h / (kPeak * kPeak / 2), 1e-7);
}

/// Of 2 arcsec at the levels that the limits of a table leave.
TEST(Coning, IsAsPublished) {
    EXPECT_NEAR(coning_bound(65, 2, 0.73 * 0.73), 0.015, 5e-4);
    EXPECT_NEAR(coning_bound(15, 2, 7.2 * 7.2), 3e-5, 6e-6);
    EXPECT_NEAR(coning_bound(125, 2, 12 * 12), 1e-4, 1e-5);
}

}  // namespace
}  // namespace vibrig::estimator
