#include "daemon/campaign/zero_calibration.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "daemon/campaign/rig_frame.hpp"
#include "estimator/filter/angles.hpp"
#include "estimator/zeros/simulation.hpp"

namespace vibrig::campaign {
namespace {

using drivers::kMillisecond;
using drivers::kSecond;
using estimator::kRadPerDeg;
using testing::HasSubstr;

constexpr double kUnitSample_s = 0.025;

/// Feeds one run, begun before, from the strapdown simulation of a unit.
void feed_run(ZeroCalibration& stage, const RigFrame& frame,
              const estimator::zeros::UnitErrors& errors, bool down, std::uint64_t seed) {
    estimator::zeros::CalibrationSettings unit;
    unit.site.latitude_rad = 45.75 * kRadPerDeg;
    unit.plan.targets_deg = {0, 88, -88, 88};
    unit.inverted = down;
    const Vector start = frame.azimuth_vertical_deg(0, down);
    Vector encoder{start[0] * kRadPerDeg, start[1] * kRadPerDeg, start[2] * kRadPerDeg};
    const double azimuth = frame.azimuth(encoder);
    estimator::zeros::UnitSimulation simulation(unit, errors, 0.01, seed);
    const double turn0 = encoder[2];
    for (int i = 0; i <= 18000 && !stage.over(); ++i) {
        const auto in = simulation.next();
        // The simulated unit's azimuth counts from east, the gimbal's from where the frame says.
        encoder[2] = turn0 + in.azimuth_rad;
        const double there = frame.azimuth(encoder);
        if (std::abs(std::remainder(there - azimuth - in.azimuth_rad, 2 * std::numbers::pi)) > 1e-9)
            encoder[2] = turn0 - in.azimuth_rad;
        rt::Motion motion;
        motion.time = kSecond + i * 10 * kMillisecond;
        motion.turn = in.turn_rad;
        motion.force = in.velocity_mps;
        motion.angle = encoder;
        motion.good = motion.increment = true;
        stage.add(motion);
    }
}

void feed_unit(ZeroCalibration& stage, const RigFrame& frame, double zero_x_mg,
               std::uint64_t seed) {
    estimator::zeros::UnitErrors errors;
    errors.zero_mg = {zero_x_mg, -3, 2};
    errors.azimuth_deg = 0;
    stage.begin();
    feed_run(stage, frame, errors, false, seed);
}

/// One whose north axis is such that the gimbal's azimuth is the simulated unit's.
estimator::Settings rig_of_the_unit() {
    estimator::Settings rig;
    const RigFrame frame(rig);
    const Vector start = frame.azimuth_vertical_deg(0, false);
    rig.azimuth_deg = frame.azimuth({start[0] * kRadPerDeg, 0, 0}) / kRadPerDeg;
    return rig;
}

TEST(ZeroCalibration, WithZDownTooItTakesZeroAndScaleOfZApart) {
    // GIVEN scale errors of 200 ppm, twice what they are said to be, and misalignments of 100 and
    // -50 arcsec
    const estimator::Settings rig = rig_of_the_unit();
    const RigFrame frame(rig);
    estimator::zeros::UnitErrors errors;
    errors.zero_mg = {5, -3, 2};
    errors.scale = {2e-4, 2e-4, 2e-4};
    constexpr double kArcsec = kRadPerDeg / 3600;
    errors.accelerometer_cross = {{{0, 0, 100 * kArcsec}, {0, 0, -50 * kArcsec}, {0, 0, 0}}};
    errors.azimuth_deg = 0;
    ZeroingSettings settings;
    settings.both_ways = false;
    ZeroCalibration one_way(settings, rig, kUnitSample_s);
    one_way.begin();
    EXPECT_FALSE(one_way.another());
    feed_run(one_way, frame, errors, false, 11);
    ASSERT_EQ(one_way.finish(false), "");
    // THEN one run has 1 g of scale error within z, and its sigma says that it may
    EXPECT_NEAR(one_way.status().zero_mg[2], 2.2, 0.01);
    EXPECT_GT(one_way.status().sigma_mg[2], 0.1);
    EXPECT_EQ(one_way.status().scale_z, 0);
    EXPECT_THAT(one_way.words(), HasSubstr("zero + 1 g x scale error"));
    // AND 1 g of misalignment within x and y, which is declared as 50 arcsec
    EXPECT_NEAR(one_way.status().zero_mg[0], 5 + 0.485, 0.02);
    EXPECT_NEAR(one_way.status().sigma_mg[0], 0.24, 0.01);
    EXPECT_THAT(one_way.words(), HasSubstr("zero + 1 g x misalignment"));
    // WHEN both runs are made
    settings.both_ways = true;
    ZeroCalibration stage(settings, rig, kUnitSample_s);
    EXPECT_EQ(stage.expected_s(), 2 * one_way.expected_s());
    stage.begin();
    ASSERT_TRUE(stage.another());
    EXPECT_EQ(stage.target_deg()[0], 90);
    feed_run(stage, frame, errors, false, 11);
    stage.begin_other_way();
    EXPECT_FALSE(stage.another());
    EXPECT_EQ(stage.target_deg()[0], -90);
    feed_run(stage, frame, errors, true, 12);
    ASSERT_EQ(stage.finish(false), "");
    // THEN they are apart, each within its own sigma
    const ZeroStatus found = stage.status();
    EXPECT_LT(found.sigma_mg[2], 0.01);
    EXPECT_NEAR(found.zero_mg[2], 2, 5 * found.sigma_mg[2]);
    EXPECT_NEAR(found.scale_z, 2e-4, 5 * found.scale_z_sigma);
    EXPECT_NEAR(found.zero_mg[0], 5, 5 * found.sigma_mg[0]);
    EXPECT_NEAR(found.zero_mg[1], -3, 5 * found.sigma_mg[1]);
    EXPECT_LT(found.sigma_mg[0], 0.01);
    EXPECT_NEAR(found.misalignment[0], 100 * kArcsec, 5 * found.misalignment_sigma[0]);
    EXPECT_NEAR(found.misalignment[1], -50 * kArcsec, 5 * found.misalignment_sigma[1]);
    EXPECT_DOUBLE_EQ(found.covariance_mg2[2][2], found.sigma_mg[2] * found.sigma_mg[2]);
    EXPECT_THAT(stage.words(), HasSubstr("misalignment +"));
    EXPECT_THAT(stage.words(), HasSubstr("scale of z +"));
    // AND the level of a dwell is then as sure as that
    EXPECT_NEAR(stage.level_sigma({90, 0, 0}), 1e-3 * found.sigma_mg[2], 1e-9);
    EXPECT_GT(one_way.level_sigma({90, 0, 0}), 1e-4);
    // WHEN the second run fails, THEN nothing is taken over
    ZeroCalibration spoilt(settings, rig, kUnitSample_s);
    spoilt.begin();
    feed_run(spoilt, frame, errors, false, 11);
    spoilt.begin_other_way();
    EXPECT_THAT(spoilt.finish(false), HasSubstr("no increments"));
    EXPECT_FALSE(spoilt.status().known);
}

TEST(ZeroCalibration, TakesTheNoiseOfOneSampleAsADensityAtItsOwnRate) {
    estimator::Settings rig = rig_of_the_unit();
    rig.accelerometer_g = 1e-3;
    for (const double rate_hz : {40.0, 100.0, 1000.0}) {
        // white noise of sigma per sample has the density sigma sqrt(period)
        EXPECT_DOUBLE_EQ(ZeroCalibration({}, rig, 1 / rate_hz).plan().noise.velocity_random_walk,
                         1e-3 / std::sqrt(rate_hz));
    }
}

TEST(ZeroCalibration, AChangeAboveThreeStandardDeviationsMarksTheCampaign) {
    // GIVEN the zeros of a unit at the start
    estimator::Settings rig = rig_of_the_unit();
    const RigFrame frame(rig);
    EXPECT_NEAR(frame.up_at_deg(frame.azimuth_vertical_deg(37, false))[2], 1, 1e-12);
    EXPECT_NEAR(frame.up_at_deg(frame.azimuth_vertical_deg(37, true))[2], -1, 1e-12);
    ZeroingSettings one_way;
    one_way.both_ways = false;
    ZeroCalibration stage(one_way, rig, kUnitSample_s);
    feed_unit(stage, frame, 5, 1);
    ASSERT_EQ(stage.finish(false), "");
    const Vector found = stage.raw_zero_g();
    EXPECT_NEAR(found[0], 5e-3, 5e-5);
    EXPECT_NEAR(found[1], -3e-3, 5e-5);
    EXPECT_NEAR(found[2], 2e-3, 5e-5);
    // WHEN it is repeated with the same zeros
    feed_unit(stage, frame, 5, 2);
    ASSERT_EQ(stage.finish(true), "");
    // THEN nothing is marked
    EXPECT_EQ(stage.status().mark, "");
    EXPECT_TRUE(stage.status().repeated);
    // WHEN x has moved by 0.2 mg, far above its standard deviation of 0.01 mg
    feed_unit(stage, frame, 5.2, 3);
    ASSERT_EQ(stage.finish(true), "");
    // THEN the campaign is marked, and the zeros of its dwells stay on show
    EXPECT_THAT(stage.status().mark, HasSubstr("accelerometer x moved by +0."));
    EXPECT_NEAR(stage.status().zero_mg[0], 5, 0.05);
    // AND an `up` that the gimbals cannot bring to the azimuth axis is refused
    rig.up = {0, 1};
    EXPECT_THROW(ZeroCalibration({}, rig, kUnitSample_s), estimator::SettingsError);
}

}  // namespace
}  // namespace vibrig::campaign
