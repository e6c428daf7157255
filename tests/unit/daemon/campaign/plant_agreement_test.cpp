// The simulations of the estimator's room, which `vibrig level simulate` and `vibrig zero simulate`
// show, against the simulated rig, which is written without them.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "daemon/campaign/rig_frame.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/levelling/simulation.hpp"
#include "estimator/zeros/simulation.hpp"
#include "tests/plant/platform_model.hpp"
#include "tests/plant/rig.hpp"

namespace vibrig::campaign {
namespace {

namespace level = estimator::levelling;
namespace zeros = estimator::zeros;
using plant::operator+, plant::operator-, plant::operator*;

constexpr double kRadian = std::numbers::pi / 180;
constexpr double kTick_s = 0.025;

TEST(ABaseThatIsNotLevel, IsWhatTheSimulatedRigMakesOfIt) {
    // GIVEN a base whose north axis points up by 1.2 deg, whichever platform axis is up
    for (const int axis : {0, 1, 2}) {
        for (const int sign : {1, -1}) {
            plant::Truth truth;
            truth.up = {axis, sign};
            truth.azimuth_deg = 30;
            truth.base_tilt_deg = {0, 1.2};
            const plant::PlatformModel rig(truth);
            estimator::Settings settings;
            settings.up = {axis, sign};
            settings.azimuth_deg = 30;
            settings.elevation_deg = 1.2;
            const estimator::Kinematics kinematics(settings);
            // THEN vertical and Earth rate are the rig's at any attitude
            for (const plant::Vec3& angles :
                 {plant::Vec3{0, 0, 0}, plant::Vec3{0.7, -0.4, 2.1}, plant::Vec3{-2.5, 0.9, 0.3}}) {
                const auto pose = kinematics.pose({angles[0], angles[1], angles[2]});
                const auto up = rig.up_at(angles), earth = rig.earth_rate_in_platform(angles);
                for (std::size_t i = 0; i < 3; ++i) {
                    EXPECT_NEAR(pose.up[static_cast<int>(i)], up[i], 1e-12) << axis << sign;
                    EXPECT_NEAR(pose.earth_rate[static_cast<int>(i)], earth[i], 1e-10)
                        << axis << sign;
                }
            }
            // AND zeroing turns about the vertical all the same
            if (axis == 0) continue;
            for (const bool down : {false, true}) {
                const RigFrame frame(settings);
                const auto up = frame.up_at_deg(frame.azimuth_vertical_deg(37, down));
                EXPECT_NEAR(up[2], down ? -1 : 1, 1e-12) << axis << sign << down;
            }
        }
    }
}

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
    level::Scenario scenario;
    scenario.loop.fast = level::design({100, 0.005, 0.7}).gains;
    scenario.loop.period_s = 4 * kTick_s;
    scenario.loop.window_s = 10;
    scenario.loop.tolerance_rad = 0.2 * level::kArcmin;
    scenario.loop.noise.accelerometer_mps2 = 1e-4 * scenario.loop.earth.gravity_mps2 / 2;
    scenario.loop.noise.gyro_random_walk =
        truth.gyro_random_walk_deg_per_rt_h * level::kPi / 180 / 60;
    scenario.duration_s = 200;
    scenario.seed = 31;
    // The free platform: what its drift and the Earth's rate make of the tilt, u' = u x w.
    const plant::Vec3 drift = rig.platform().gyro_drift(up, 0);
    const plant::Vec3 earth = rig.platform().earth_rate_in_platform(rig.platform().angles());
    const plant::Vec3 rate = level::kDegPerHour * (double(truth.drift_sign) * drift - earth);
    for (std::size_t a = 0; a < 2; ++a) {
        scenario.tilt[a] = dot(channel[a], up);
        scenario.drift[a] = dot(channel[a], plant::cross(up, rate));
    }
    // WHEN the loop is closed over the rig, and over the simulation
    level::Leveller loop(scenario.loop);
    std::vector<level::Pair> tilt;
    for (int step = 0; step < 2000; ++step) {
        const plant::Vec3 now = rig.platform().up_in_platform();
        tilt.push_back({dot(channel[0], now), dot(channel[1], now)});
        plant::Vec3 force{};
        for (int i = 0; i < 4; ++i) {
            rig.advance();
            force = force + 0.25 * rig.readings().raw_g;
        }
        level::LevelInput input;
        for (std::size_t a = 0; a < 2; ++a)
            input.force[a] = scenario.loop.earth.gravity_mps2 * dot(channel[a], force);
        const auto out = loop.step(input).rate;
        rig.torque((1 / level::kDegPerHour) * (out[0] * channel[1] - out[1] * channel[0]));
    }
    const level::SimulatedStart simulated = level::simulate(scenario);
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
    EXPECT_EQ(simulated.verdict, level::Verdict::settled);
    EXPECT_NEAR(*loop.settled_s(), simulated.settled_s, 0.5 / loop.sigma());
    for (std::size_t a = 0; a < 2; ++a) {
        EXPECT_NEAR(loop.drift()[a], scenario.drift[a], 4 * loop.drift_sigma());
        EXPECT_NEAR(simulated.drift[a], scenario.drift[a], 4 * loop.drift_sigma());
    }
}

TEST(SimulatedUnit, GivesTheIncrementsOfTheSimulatedRig) {
    // GIVEN a rig whose azimuth is the unit's, with zeros and constant drift, without noise
    estimator::Settings settings;
    {
        const RigFrame frame(settings);
        settings.azimuth_deg = frame.azimuth({0.5 * std::numbers::pi, 0, 0}) / kRadian;
    }
    const RigFrame frame(settings);
    plant::Truth truth;
    truth.azimuth_deg = settings.azimuth_deg;
    truth.zero_g = {0.005, -0.003, 0.002};
    truth.gyro_random_walk_deg_per_rt_h = truth.accelerometer_g = 0;
    truth.slew_kick_g = 0;
    truth.coefficients = {};
    zeros::CalibrationSettings calibration;
    calibration.site.latitude_rad = truth.latitude_deg * kRadian;
    calibration.noise.angle_random_walk = calibration.noise.velocity_random_walk = 0;
    zeros::UnitErrors errors;
    errors.tilt_east_deg = errors.tilt_north_deg = errors.azimuth_deg = 0;
    for (std::size_t i = 0; i < 3; ++i) {
        errors.zero_mg[i] = 1e3 * truth.zero_g[i];
        errors.gyro_bias_deg_h[i] = 0.1 * static_cast<double>(i + 1);
        // Nulled by the loop it turns the platform by drift_sign times it.
        truth.coefficients[i][plant::kF] = -truth.drift_sign * errors.gyro_bias_deg_h[i];
    }
    plant::Rig rig(truth);
    const double forth = frame.azimuth({0.5 * std::numbers::pi, 0, 0.1}) > 0 ? 1 : -1;
    const auto target = [&](double azimuth_deg) { return plant::Vec3{90, 0, forth * azimuth_deg}; };
    rig.slew_to(target(0));
    // Until a whole 10 ms, from where the rig's increments count.
    while (!rig.gimbals().in_position() || rig.time_us() % 50'000 != 0) rig.advance();
    // WHEN both go through the plan
    zeros::UnitSimulation unit(calibration, errors, 0.01, 1);
    static_cast<void>(unit.next());
    static_cast<void>(unit.next());  // the rig's first increment begins 10 ms after its slew
    std::size_t at = 1;
    rig.slew_to(target(calibration.plan.targets_deg[at]), plant::GimbalMode::calibrate);
    plant::Vec3 turn{}, velocity{};
    int count = 0;
    while (rig.time_us() < 200'000'000 && at < calibration.plan.targets_deg.size()) {
        rig.advance();
        for (const plant::Increment& made : rig.increments()) {
            const auto expected = unit.next();
            for (std::size_t i = 0; i < 3; ++i) {
                turn[i] += made.turn_arcsec[i] - expected.turn_rad[i] / kRadian * 3600;
                velocity[i] += made.velocity_mps[i] - expected.velocity_mps[i];
                // THEN the sums stay together: counts of 0.002 arcsec and 1e-5 m/s, and 0.01 deg/h
                // and 1 ug of the integration
                const double time_s = 0.01 * ++count / 3;
                ASSERT_NEAR(turn[i], 0, 0.004 + 0.01 * time_s) << "axis " << i << ", " << time_s;
                ASSERT_NEAR(velocity[i], 0, 2e-5 + 1e-5 * time_s) << "axis " << i << ", " << time_s;
            }
        }
        if (rig.gimbals().in_position() && ++at < calibration.plan.targets_deg.size())
            rig.slew_to(target(calibration.plan.targets_deg[at]), plant::GimbalMode::calibrate);
    }
    EXPECT_GE(count, 3 * 100 * 85);
}

}  // namespace
}  // namespace vibrig::campaign
