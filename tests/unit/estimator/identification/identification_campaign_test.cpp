#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "estimator/identification/identification.hpp"
#include "estimator/identification/result.hpp"
#include "tests/unit/estimator/rig_simulator.hpp"

namespace vibrig::estimator::testing {
namespace {

TEST(Campaign, TwoLevelsDetermineAllThirtyCoefficients) {
    const std::uint64_t seed = 1;
    SCOPED_TRACE("seed " + std::to_string(seed));
    // GIVEN the 14 positions at 6 and 4.667 g on the platform
    Identification identification{Settings{}};
    RigSimulator rig(seed);
    rig.campaign(identification, {6.0, 4.667});

    // WHEN the result is taken
    const Result result = identification.result();

    // THEN every coefficient is observable and within 4 sigma of the truth
    for (std::size_t i = 0; i < kParameters; ++i) {
        EXPECT_TRUE(result.observable[i]) << parameter_names()[i];
        EXPECT_LT(std::abs(result.value[i] - kTable2[i]), 4 * result.sigma[i])
            << parameter_names()[i];
    }
    EXPECT_TRUE(result.combinations.empty());
    EXPECT_NEAR(result.nis_per_dof, 1.0, 0.02);
}

Result campaign_with_cross_motion(SecondMoment how, double east, std::uint64_t seed) {
    Settings settings;
    settings.second_moment = how;
    Identification identification{settings};
    RigSimulator rig(seed);
    SimulatedDwell plan;
    plan.duration_s = 30;
    plan.cross_east = east;
    rig.campaign(identification, {6.0, 4.667}, plan);
    return identification.result();
}

TEST(Campaign, MotionAcrossTheVerticalIsMeasuredAndDoesNoHarm) {
    const std::uint64_t seed = 3;
    SCOPED_TRACE("seed " + std::to_string(seed));
    // GIVEN a platform that moves east by a tenth of its vertical vibration, in phase, and one that
    // does not, with the same noise
    const Result clean = campaign_with_cross_motion(SecondMoment::measured, 0, seed);
    // WHEN that is taken as vertical, or measured
    const auto shift = [&](SecondMoment how) {
        const Result shaken = campaign_with_cross_motion(how, 0.1, seed);
        double largest = 0;
        for (std::size_t i = 0; i < kParameters; ++i)
            largest =
                std::max(largest, std::abs(shaken.value[i] - clean.value[i]) / clean.sigma[i]);
        return largest;
    };
    // THEN it moves a coefficient by many sigma, or by less than one
    EXPECT_GT(shift(SecondMoment::vertical), 8);
    EXPECT_LT(shift(SecondMoment::measured), 0.7);
}

TEST(Campaign, ADwellTellsTheShapeOfItsVibration) {
    for (const SecondMoment how : {SecondMoment::measured, SecondMoment::vertical}) {
        Settings settings;
        settings.second_moment = how;
        Identification identification{settings};
        RigSimulator rig(5);
        SimulatedDwell plan;
        plan.angles_deg = kTable1[5];
        plan.duration_s = 20;
        plan.cross_north = 0.05;
        plan.cross_east = -0.1;
        plan.lost_probability = 0.01;
        const DwellSummary summary = rig.dwell(identification, plan);
        const LevelTensor expected = how == SecondMoment::measured
                                         ? LevelTensor{0.0025, 1, 0.01, 0.05, -0.005, -0.1}
                                         : kVertical;
        for (std::size_t k = 0; k < expected.size(); ++k)
            EXPECT_NEAR(summary.gamma[k], expected[k], 5e-5) << k;
    }
}

}  // namespace
}  // namespace vibrig::estimator::testing
