#include "estimator/levelling/simulation.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "estimator/filter/angles.hpp"
#include "tests/plant/rig.hpp"

namespace vibrig::estimator::levelling {
namespace {

using plant::dot, plant::operator+, plant::operator-, plant::operator*;

constexpr double kTick_s = 0.025;

/// As `vibrig level simulate` shows it, against the simulated rig, which is written without it.
TEST(SimulatedStart, LevelsAsTheSimulatedRigDoes) {
    // GIVEN the rig in position 1, half a degree off level, drifting as its gyros do
    plant::Truth truth;
    truth.seed = 31;
    plant::Rig rig(truth);
    rig.slew_to({0.45, 0, -0.3});
    for (int i = 0; i < 400 && !rig.gimbals().in_position(); ++i) rig.advance();
    ASSERT_TRUE(rig.gimbals().in_position());
    rig.release();
    const plant::Vec3 up = rig.platform().up_in_platform();
    const std::array<plant::Vec3, 2> channel{{{1, 0, 0}, {0, 0, -1}}};  // first x second = up
    Scenario scenario;
    scenario.loop.fast = design({100, 0.005, 0.7}).gains;
    scenario.loop.period_s = 4 * kTick_s;
    scenario.loop.window_s = 10;
    scenario.loop.tolerance_rad = 0.2 * kRadPerArcmin;
    scenario.loop.noise.accelerometer_mps2 = 1e-4 * scenario.loop.earth.gravity_mps2 / 2;
    scenario.loop.noise.gyro_random_walk = truth.gyro_random_walk_deg_per_rt_h * kDegPerRootHour;
    scenario.duration_s = 200;
    scenario.seed = 31;
    // The free platform: what its drift and the Earth's rate make of the tilt, u' = u x w.
    const plant::Vec3 drift = rig.platform().gyro_drift(up, 0);
    const plant::Vec3 earth = rig.platform().earth_rate_in_platform(rig.platform().angles());
    const plant::Vec3 rate = kDegPerHour * (double(truth.drift_sign) * drift - earth);
    for (std::size_t a = 0; a < 2; ++a) {
        scenario.tilt[a] = dot(channel[a], up);
        scenario.drift[a] = dot(channel[a], plant::cross(up, rate));
    }
    // WHEN the loop is closed over the rig, and over the simulation
    Leveller loop(scenario.loop);
    std::vector<Pair> tilt;
    for (int step = 0; step < 2000; ++step) {
        const plant::Vec3 now = rig.platform().up_in_platform();
        tilt.push_back({dot(channel[0], now), dot(channel[1], now)});
        plant::Vec3 force{};
        for (int i = 0; i < 4; ++i) {
            rig.advance();
            force = force + 0.25 * rig.readings().raw_g;
        }
        LevelInput input;
        for (std::size_t a = 0; a < 2; ++a)
            input.force[a] = scenario.loop.earth.gravity_mps2 * dot(channel[a], force);
        const auto out = loop.step(input).rate;
        rig.torque((1 / kDegPerHour) * (out[0] * channel[1] - out[1] * channel[0]));
    }
    const SimulatedStart simulated = simulate(scenario);
    // THEN the tilts agree within 1 % of the start and what the noise makes of both
    ASSERT_EQ(simulated.trace.size(), tilt.size());
    const double noise = 5 * std::sqrt(2) * loop.budget().total;
    for (std::size_t k = 0; k < tilt.size(); ++k) {
        for (std::size_t a = 0; a < 2; ++a) {
            ASSERT_NEAR(tilt[k][a], simulated.trace[k].tilt[a],
                        0.01 * std::abs(scenario.tilt[a]) + noise)
                << "after " << simulated.trace[k].time_s << " s, seed 31";
        }
    }
    // AND both have settled at about the same time and found the same drift
    ASSERT_TRUE(loop.settled_s());
    EXPECT_EQ(simulated.verdict, Verdict::settled);
    EXPECT_NEAR(*loop.settled_s(), simulated.settled_s, 0.5 / loop.sigma());
    for (std::size_t a = 0; a < 2; ++a) {
        EXPECT_NEAR(loop.drift()[a], scenario.drift[a], 4 * loop.drift_sigma());
        EXPECT_NEAR(simulated.drift[a], scenario.drift[a], 4 * loop.drift_sigma());
    }
}

}  // namespace
}  // namespace vibrig::estimator::levelling
