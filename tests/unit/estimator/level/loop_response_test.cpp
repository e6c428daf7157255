#include "estimator/level/loop_response.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "estimator/filter/angles.hpp"

namespace vibrig::estimator {
namespace {

struct Platform {
    double frequency_hz = 15, platform_g = 0.3333, table_g = 0.5, phase_deg = -125;
    double cross = 0, harmonic = 0;
    std::array<double, 3> up{0.6, 0.8, 0};
};

std::vector<LoopReading> readings_of(const Platform& p) {
    std::mt19937_64 generator(31);
    std::normal_distribution<double> normal;
    std::vector<LoopReading> readings;
    for (int n = 0; n < 200; ++n) {
        LoopReading r;
        r.time_s = 1000 + n * 0.025;
        const double angle = 2 * kPi * p.frequency_hz * r.time_s;
        const double lag = p.phase_deg * kPi / 180;
        const double a =
            1 + p.platform_g * (std::cos(angle + lag) + p.harmonic * std::cos(2 * angle));
        r.force_g = {a * p.up[0], a * p.up[1], a * p.up[2]};
        r.force_g[2] += p.cross * p.platform_g * std::cos(angle);  // across: up[2] is 0
        for (double& force : r.force_g) force += 1e-4 * normal(generator);
        r.table_g = p.table_g * std::cos(angle) + 1e-3 * normal(generator);
        r.table_good = true;
        readings.push_back(r);
    }
    return readings;
}

TEST(LoopResponse, FindsAmplitudesFrequencyAndPhase) {
    const auto found = loop_response(readings_of({.frequency_hz = 15.03}), 15);
    EXPECT_NEAR(found.frequency_hz, 15.03, 1e-4);
    EXPECT_NEAR(found.platform_g, 0.3333, 1e-4);
    EXPECT_NEAR(found.table_g, 0.5, 5e-4);
    EXPECT_NEAR(found.phase_deg, -125, 0.2);
    EXPECT_NEAR(found.mean_force_g, 1, 1e-4);
    EXPECT_LT(found.distortion, 1e-3);
    EXPECT_LT(found.cross_share, 1e-3);
    EXPECT_TRUE(found.table_known);
}

TEST(LoopResponse, TellsDistortionAndMotionAcross) {
    // 1e-4 g of noise beside 0.33 g
    EXPECT_NEAR(loop_response(readings_of({.harmonic = 0.1}), 15).distortion, 0.1, 2e-3);
    EXPECT_NEAR(loop_response(readings_of({.cross = 0.25}), 15).cross_share, 0.25, 2e-3);
    // a table at another frequency is no clean sine at the nominal one
    EXPECT_GT(loop_response(readings_of({.frequency_hz = 13.7}), 15).distortion, 0.5);
}

TEST(LoopResponse, KnowsNoPhaseWithoutEveryReadingOfTheTable) {
    auto readings = readings_of({});
    readings[7].table_good = false;
    const auto found = loop_response(readings, 15);
    EXPECT_FALSE(found.table_known);
    EXPECT_NEAR(found.platform_g, 0.3333, 1e-4);
}

TEST(LoopResponse, SaysNothingOfTooFewReadings) {
    const auto readings = readings_of({});
    EXPECT_EQ(loop_response(std::span(readings).first(9), 15).platform_g, 0);
    EXPECT_EQ(loop_response({}, 15).frequency_hz, 0);
}

}  // namespace
}  // namespace vibrig::estimator
