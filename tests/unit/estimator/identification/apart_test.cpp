#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "estimator/identification/result.hpp"
#include "tests/unit/estimator/rig_simulator.hpp"

// Dwells at another frequency, and dwells held out: rows, and nothing to the coefficients.

namespace vibrig::estimator::testing {
namespace {

constexpr double kApart_hz = 35.1;

SimulatedDwell apart_at(int run, int position, double hz) {
    SimulatedDwell plan;
    plan.info = {run, position, -1, 60.0 * position + 2000.0 * run};
    plan.angles_deg = kTable1[static_cast<std::size_t>(position - 1)];
    plan.amplitude_g = run == 2 ? 0 : 6;
    plan.duration_s = 30;
    plan.frequency_hz = hz;
    return plan;
}

/// 14 positions at 6 g and 14 at rest; between them, if asked for, dwells of another rig: at
/// another frequency, where its quadratic coefficients are others, and one held out.
void apart_campaign(Identification& to, bool with_apart) {
    RigSimulator rig(11), elsewhere(12);
    for (std::size_t i = 0; i < kParameters; ++i) {
        if (i % 10 >= 4) elsewhere.truth[i] *= 3;
    }
    for (int run = 1; run <= 2; ++run) {
        for (int position = 1; position <= 14; ++position) {
            rig.dwell(to, apart_at(run, position, 15));
            if (!with_apart || position != 7) continue;
            SimulatedDwell apart = apart_at(2 + run, position, run == 1 ? kApart_hz : 15);
            apart.info.frequency_hz = run == 1 ? kApart_hz : 0;
            apart.info.held_out = run == 2;
            const DwellSummary summary = elsewhere.dwell(to, apart);
            EXPECT_FALSE(summary.flagged) << summary.reason;
            EXPECT_NEAR(summary.nis_per_dof, 1, 0.1);
        }
    }
}

TEST(Apart, LeavesTheCoefficientsAsTheyWereToTheLastBit) {
    Identification without{Settings{}}, with{Settings{}};
    apart_campaign(without, false);
    apart_campaign(with, true);
    const Result expected = without.result(), found = with.result();
    EXPECT_EQ(found.value, expected.value);
    EXPECT_EQ(found.sigma, expected.sigma);
    EXPECT_EQ(with.covariance_now(), without.covariance_now());
    EXPECT_EQ(found.rows.size(), 28U);
    EXPECT_TRUE(found.cross_check.done && found.cross_check.agrees());
    // AND the live filter goes on as before
    Estimate a, b;
    with.estimate(a);
    without.estimate(b);
    EXPECT_EQ(a.value, b.value);
}

TEST(Apart, ItsRowIsThatOfAFilterOfItsOwn) {
    Identification with{Settings{}};
    apart_campaign(with, true);
    ASSERT_EQ(with.rows().size(), 30U);
    const DwellRow& row = with.rows()[7];
    EXPECT_TRUE(row.apart && !row.held_out);
    EXPECT_EQ(row.commanded_hz, kApart_hz);
    EXPECT_NEAR(row.frequency_hz, kApart_hz, 0.01);
    const DwellRow& held_out = with.rows()[22];
    EXPECT_TRUE(held_out.apart && held_out.held_out);

    Settings own;
    own.frequency_hz = kApart_hz;
    Identification alone(own);
    RigSimulator elsewhere(12);
    for (std::size_t i = 0; i < kParameters; ++i) {
        if (i % 10 >= 4) elsewhere.truth[i] *= 3;
    }
    elsewhere.dwell(alone, apart_at(3, 7, kApart_hz));
    ASSERT_EQ(alone.rows().size(), 1U);
    for (Eigen::Index j = 0; j < 3; ++j) {
        const double sigma = std::sqrt(row.variance(j, j));
        EXPECT_NEAR(row.rate[j], alone.rows()[0].rate[j], 0.1 * sigma);
        EXPECT_NEAR(sigma, std::sqrt(alone.rows()[0].variance(j, j)), 0.01 * sigma);
    }
}

TEST(Apart, AVibrationThatIsNotAtItsCommandedFrequencyIsRejected) {
    Identification to{Settings{}};
    RigSimulator rig(13);
    SimulatedDwell plan = apart_at(1, 1, kApart_hz);
    plan.info.frequency_hz = kApart_hz + 0.1;
    const DwellSummary off = rig.dwell(to, plan);
    EXPECT_TRUE(off.left_out);
    EXPECT_NE(std::string(off.reason).find("commanded frequency"), std::string::npos) << off.reason;
    plan.info.frequency_hz = kApart_hz + 0.02;
    EXPECT_FALSE(rig.dwell(to, plan).left_out);
}

/// Through a resonance the drift is none that a filter could follow: it does not see a sweep.
TEST(Apart, ASweepIsNoRowAndLeavesTheFilterAlone) {
    Identification without{Settings{}}, with{Settings{}};
    RigSimulator rig(11), same(11), elsewhere(12);
    for (double& value : elsewhere.truth) value *= 30;
    for (int run = 1; run <= 2; ++run) {
        for (int position = 1; position <= 14; ++position) {
            rig.dwell(without, apart_at(run, position, 15));
            same.dwell(with, apart_at(run, position, 15));
            if (position != 7) continue;
            SimulatedDwell swept = apart_at(3, run, 15);
            swept.info.sweep = {20, 120, 30};
            const DwellSummary summary = elsewhere.dwell(with, swept);
            EXPECT_FALSE(summary.flagged || summary.left_out) << summary.reason;
            EXPECT_EQ(summary.samples, 1200U);
            EXPECT_EQ(summary.used, 1200U);
            EXPECT_EQ(summary.nis_per_dof, 0);
            EXPECT_NEAR(summary.amplitude_g, 6, 0.05);
        }
    }
    EXPECT_EQ(with.result().value, without.result().value);
    EXPECT_EQ(with.rows().size(), 28U);
    EXPECT_EQ(with.covariance_now(), without.covariance_now());
    EXPECT_EQ(with.result().dwells.size(), 30U);
}

/// A dead accelerometer is no sweep.
TEST(Apart, ASweepWithoutForceIsLeftOut) {
    Identification to{Settings{}};
    RigSimulator rig(11);
    rig.spoil = [](const DwellInfo&, int, Measurement& m) { m.force_good = false; };
    SimulatedDwell swept = apart_at(3, 1, 15);
    swept.info.sweep = {20, 120, 30};
    const DwellSummary summary = rig.dwell(to, swept);
    EXPECT_TRUE(summary.flagged && summary.left_out);
    EXPECT_STREQ(summary.reason, "no usable specific force");
    EXPECT_EQ(summary.used, 0U);
}

}  // namespace
}  // namespace vibrig::estimator::testing
