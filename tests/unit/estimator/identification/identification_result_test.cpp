#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "tests/unit/estimator/identification/identified.hpp"

namespace vibrig::estimator::testing {
namespace {

TEST(CrossCheck, TheBatchAgreesWithTheFilterOnEitherRouteAndAtOneLevel) {
    SCOPED_TRACE("seed " + std::to_string(kCrossSeed));
    Settings joint, two_step;
    two_step.method = Method::two_step;
    // GIVEN campaigns with gaps and spikes WHEN they are identified
    for (const Result& result : {identified(joint, {6, 14.0 / 3}), identified(two_step, {6, 4}),
                                 identified(joint, {6, 6}), identified(joint, {6, 0})}) {
        // THEN the batch was done, differs from the filter by rounding and linearisation only and
        // nobody is warned
        EXPECT_TRUE(result.cross_check.done);
        EXPECT_GT(result.cross_check.largest, 0) << "two ways never agree to the last bit";
        EXPECT_LE(result.cross_check.largest, CrossCheck::kLimit) << result.cross_check.coefficient;
        EXPECT_FALSE(reported(result, "batch least squares"));
    }
}

TEST(CrossCheck, ADisagreementNamesItsCoefficient) {
    SCOPED_TRACE("seed " + std::to_string(kCrossSeed));
    // GIVEN a gate that lets everything in and angles off by 20 deg now and then, which tilt the
    // vertical of the batch but not that of the filter
    Settings settings;
    settings.gate_nis = 1e9;
    const Result result =
        identified(settings, {6, 14.0 / 3}, [](const DwellInfo&, int n, Measurement& m) {
            if (n % 100 == 50) m.angle_rad[0] += 0.35;
        });
    // THEN the warning names the coefficient that differs most
    EXPECT_FALSE(result.cross_check.agrees());
    EXPECT_TRUE(reported(result, "puts " + result.cross_check.coefficient + " off by"));
}

TEST(RunAmplitudes, OfSeveralLevelsUnderOneRunNumberThereIsNoneAndThatIsSaid) {
    const auto two_dwells = [](double first_g, double second_g) {
        Identification identification{Settings{}};
        RigSimulator rig(kCrossSeed);
        SimulatedDwell plan;
        plan.duration_s = 20;
        for (const double level_g : {first_g, second_g}) {
            plan.info = {1, plan.info.position + 1, -1};
            plan.amplitude_g = level_g;
            rig.dwell(identification, plan);
        }
        return identification.result();
    };
    for (const double second_g : {0.0, 14.0 / 3}) {
        const Result mixed = two_dwells(6, second_g);
        ASSERT_EQ(mixed.amplitudes.size(), 1U);
        EXPECT_TRUE(std::isnan(mixed.amplitudes[0].amplitude_g)) << second_g;
        EXPECT_FALSE(mixed.amplitudes[0].sigma_g > 0);
        EXPECT_TRUE(reported(mixed, "run 1: found dwells from ")) << second_g;
    }
    const Result one = two_dwells(6, 6);
    EXPECT_NEAR(one.amplitudes[0].amplitude_g, 6, 0.01);
    EXPECT_FALSE(reported(one, "under one run number"));
}

TEST(CrossCheck, WithoutDataNothingIsCompared) {
    EXPECT_FALSE(Identification(Settings{}).result().cross_check.done);
}

}  // namespace
}  // namespace vibrig::estimator::testing
