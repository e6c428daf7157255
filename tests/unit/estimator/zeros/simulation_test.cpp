#include "estimator/zeros/simulation.hpp"

#include <gtest/gtest.h>

#include <numbers>

#include "daemon/campaign/rig_frame.hpp"
#include "estimator/filter/angles.hpp"
#include "tests/plant/rig.hpp"

namespace vibrig::estimator::zeros {
namespace {

/// As `vibrig zero simulate` shows it, against the simulated rig, which is written without it.
TEST(SimulatedUnit, GivesTheIncrementsOfTheSimulatedRig) {
    // GIVEN a rig whose azimuth is the unit's, with zeros and constant drift, without noise
    Settings settings;
    {
        const campaign::RigFrame frame(settings);
        settings.azimuth_deg = frame.azimuth({0.5 * std::numbers::pi, 0, 0}) / kRadPerDeg;
    }
    const campaign::RigFrame frame(settings);
    plant::Truth truth;
    truth.azimuth_deg = settings.azimuth_deg;
    truth.zero_g = {0.005, -0.003, 0.002};
    truth.gyro_random_walk_deg_per_rt_h = truth.accelerometer_g = 0;
    truth.slew_kick_g = 0;
    truth.coefficients = {};
    CalibrationSettings calibration;
    calibration.site.latitude_rad = truth.latitude_deg * kRadPerDeg;
    calibration.noise.angle_random_walk = calibration.noise.velocity_random_walk = 0;
    UnitErrors errors;
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
    UnitSimulation unit(calibration, errors, 0.01, 1);
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
                turn[i] += made.turn_arcsec[i] - expected.turn_rad[i] / kRadPerDeg * 3600;
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
}  // namespace vibrig::estimator::zeros
