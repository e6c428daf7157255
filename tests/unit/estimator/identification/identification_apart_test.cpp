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
    for (std::size_t j = 0; j < 3; ++j) {
        const double sigma = std::sqrt(row.variance[j][j]);
        EXPECT_NEAR(row.rate[j], alone.rows()[0].rate[j], 0.1 * sigma);
        EXPECT_NEAR(sigma, std::sqrt(alone.rows()[0].variance[j][j]), 0.01 * sigma);
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
    // Nor has it innovations that could be too small.
    EXPECT_EQ(with.result().warnings, without.result().warnings);
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

/// A random dwell once more with what a controller reports as played, 40 s of 40/s: samples know
/// the mean square to sqrt(2/1600) = 3.5 %, the PSD of 100 Hz to 1.6 % and its gain 1 %.
struct PlayedDwell : ::testing::Test {
    static constexpr double kLevel_g = 6;
    Identification to{Settings{}};
    RigSimulator rig{11};
    DwellSummary before;
    PlayedDwell() {
        SimulatedDwell plan = apart_at(1, 1, 15);
        // Its profile has what a sine of 6 g shows at the platform.
        plan.info.random = {kLevel_g * kLevel_g / 2, 100, 0.01, 500, 4, 0};
        before = rig.dwell(to, plan);
    }
    [[nodiscard]] static PlayedRandom reported(double times) {
        return {PlayedRandom::Word::good,
                {times * kLevel_g * kLevel_g / 2, 100, 0.01, 500, 4, 0},
                {},
                3};
    }
};

TEST_F(PlayedDwell, HasThePsdsLevel) {
    ASSERT_FALSE(before.left_out) << before.reason;
    ASSERT_EQ(to.rows().size(), 1U);
    const DwellRow was = to.rows()[0];
    const DwellSummary now = to.played(reported(1.05));
    EXPECT_FALSE(now.flagged) << now.reason;
    ASSERT_EQ(to.rows().size(), 1U);
    const DwellRow& row = to.rows()[0];
    EXPECT_EQ(row.psd, 3U);
    EXPECT_EQ(row.rate, was.rate);
    EXPECT_EQ(row.variance, was.variance);
    // The PSD weighs as its certainty against that of the samples.
    const double psd = 1 / (1.0 / (100 * 40) + 1e-4), samples = 1600 / 2.0;
    EXPECT_NEAR((row.vibration.kappa - 1) / (was.vibration.kappa - 1),
                1 + 0.05 * psd / (psd + samples), 2e-3);
    EXPECT_EQ(now.kappa, row.vibration.kappa);
    EXPECT_EQ(to.result().dwells.back().kappa, now.kappa);
    EXPECT_EQ(to.played(reported(1)).samples, 0U) << "once for each dwell";
}

TEST_F(PlayedDwell, OneThatTheAccelerometersContradictIsRejected) {
    const DwellSummary now = to.played(reported(1.3));
    EXPECT_TRUE(now.left_out && now.flagged);
    EXPECT_NE(std::string(now.reason).find("the controller's PSD disagree"), std::string::npos);
    EXPECT_EQ(now.used, 0U);
    EXPECT_TRUE(to.rows().empty());
}

/// Its profile's level was not what was played, and the PSD says so.
TEST_F(PlayedDwell, OneThatItsProfileContradictedComesBack) {
    SimulatedDwell plan = apart_at(1, 2, 15);
    plan.info.random = {1.3 * kLevel_g * kLevel_g / 2, 100, 0.01, 500, 4, 0};
    ASSERT_TRUE(rig.dwell(to, plan).left_out);
    ASSERT_EQ(to.rows().size(), 1U);
    const DwellSummary now = to.played(reported(1));
    EXPECT_FALSE(now.left_out) << now.reason;
    EXPECT_GT(now.used, 0U);
    ASSERT_EQ(to.rows().size(), 2U);
    EXPECT_EQ(to.rows().back().position, 2);
}

TEST_F(PlayedDwell, WhatIsRefusedOrNotReadSaysSo) {
    Identification other{Settings{}};
    RigSimulator same{11};
    SimulatedDwell plan = apart_at(1, 1, 15);
    plan.info.random = {kLevel_g * kLevel_g / 2, 100, 0.01, 500, 4, 0};
    static_cast<void>(same.dwell(other, plan));
    PlayedRandom none;
    none.word = PlayedRandom::Word::not_read;
    const DwellSummary unread = to.played(none);
    EXPECT_TRUE(unread.flagged && unread.followed && !unread.left_out);
    EXPECT_EQ(unread.kappa, before.kappa) << "its profile's stands";
    ASSERT_EQ(to.rows().size(), 1U);
    EXPECT_EQ(to.rows()[0].psd, 0U);
    none.word = PlayedRandom::Word::refused;
    const DwellSummary refused = other.played(none);
    EXPECT_TRUE(refused.flagged && refused.left_out);
    EXPECT_TRUE(other.rows().empty());
}

/// Its blocks are made when it is whole: what was cut short is in no result, and says so.
TEST(Apart, ASweepThatWasCutShortIsNotUsed) {
    Identification to{Settings{}};
    RigSimulator rig(11);
    SimulatedDwell swept = apart_at(3, 1, 15);
    swept.info.sweep = {20, 120, 30};
    to.begin_dwell(swept.info);
    for (int i = 0; i < 400; ++i)
        static_cast<void>(to.add({.time_s = 0.025 * i, .force_g = {0, i % 2 == 0 ? 2.0 : 0.0, 0}}));
    const DwellSummary summary = to.end_dwell(true);
    EXPECT_TRUE(summary.flagged && summary.left_out);
    EXPECT_STREQ(summary.reason, "a sweep that was cut short: not used");
    EXPECT_EQ(summary.samples, 400U);
    EXPECT_EQ(summary.used, 0U);
    EXPECT_EQ(to.result().dwells.back().used, 0U);
}

/// A dwell that stands counts with what it has.
TEST(Apart, ADwellThatWasCutShortCountsWithWhatItHas) {
    Identification to{Settings{}};
    RigSimulator rig(11);
    static_cast<void>(rig.dwell(to, apart_at(1, 1, 15)));
    to.begin_dwell({1, 2});
    for (int i = 0; i < 400; ++i)
        static_cast<void>(to.add({.time_s = 0.025 * i, .force_g = {0, 1, 0}}));
    const DwellSummary summary = to.end_dwell(true);
    EXPECT_FALSE(summary.left_out);
    EXPECT_GT(summary.used, 300U);
    ASSERT_EQ(to.rows().size(), 2U);
    EXPECT_EQ(to.rows().back().position, 2);
}

}  // namespace
}  // namespace vibrig::estimator::testing
