#include "daemon/archive/trend.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "tests/unit/daemon/archive/entries.hpp"

namespace vibrig::archive {
namespace {

constexpr unsigned kSeed = 22;
constexpr double kU = 0.1;

/// Campaigns in groups of a turn-on each.
struct Drawn {
    std::vector<double> value, u;
    std::vector<std::size_t> group;
};
Drawn draw(std::mt19937& random, std::size_t groups, std::size_t each, double operating,
           double shutdown) {
    std::normal_distribution<double> normal;
    Drawn out;
    for (std::size_t g = 0; g < groups; ++g) {
        const double turn = shutdown * normal(random);
        for (std::size_t i = 0; i < each; ++i) {
            // Uncertainties that differ, as those of long and short campaigns do.
            const double u = kU * (i % 2 == 0 ? 1 : 1.5);
            out.value.push_back(3 + turn + operating * normal(random) + u * normal(random));
            out.u.push_back(u);
            out.group.push_back(g);
        }
    }
    return out;
}

/// Half width of the 4 sigma interval of a share.
double four_sigma(double share, int trials) { return 4 * std::sqrt(share * (1 - share) / trials); }

TEST(Trend, FTestsSayNoAsOftenAsTheyClaim) {
    constexpr int kTrials = 4000;
    constexpr double kLevel = 0.05;
    std::mt19937 random(kSeed);
    int operating = 0, shutdown = 0;
    for (int i = 0; i < kTrials; ++i) {
        const Drawn of = draw(random, 5, 4, 0, 0);
        const auto found = analyse_variance(of.value, of.u, of.group);
        operating += found.within.p < kLevel;
        shutdown += found.between.p < kLevel;
    }
    EXPECT_NEAR(static_cast<double>(operating) / kTrials, kLevel, four_sigma(kLevel, kTrials))
        << "seed " << kSeed;
    // Against whichever is larger, the scatter within or what it should be: at most the level.
    EXPECT_LT(static_cast<double>(shutdown) / kTrials, kLevel + four_sigma(kLevel, kTrials))
        << "seed " << kSeed;
    EXPECT_GT(static_cast<double>(shutdown) / kTrials, kLevel / 3) << "seed " << kSeed;
}

TEST(Trend, FindsTheInstabilitiesThatAreThere) {
    constexpr int kTrials = 400;
    constexpr double kOperating = 0.2, kShutdown = 0.5;
    std::mt19937 random(kSeed);
    double operating = 0, shutdown = 0, found_shutdown = 0;
    for (int i = 0; i < kTrials; ++i) {
        const Drawn of = draw(random, 12, 6, kOperating, kShutdown);
        const auto found = analyse_variance(of.value, of.u, of.group);
        operating += found.within.value * found.within.value / kTrials;
        shutdown += found.between.value * found.between.value / kTrials;
        found_shutdown += (found.between.p < 0.01 ? 1.0 / kTrials : 0);
    }
    // Variances of chi-square with 60 and 11 degrees of freedom: 4 sigma of the mean of 400.
    EXPECT_NEAR(operating, kOperating * kOperating, 4 * 0.04 * 1.7 * std::sqrt(2 / 60. / kTrials));
    EXPECT_NEAR(shutdown, kShutdown * kShutdown, 4 * 0.25 * 1.3 * std::sqrt(2 / 11. / kTrials));
    EXPECT_GT(found_shutdown, 0.9);
}

/// Share of the 95 % intervals of the mean that have it.
double coverage(std::size_t groups, std::size_t each, double operating, double shutdown) {
    constexpr int kTrials = 2000;
    std::mt19937 random(kSeed);
    int within = 0;
    for (int i = 0; i < kTrials; ++i) {
        const Drawn of = draw(random, groups, each, operating, shutdown);
        std::vector<Entry> history;
        for (std::size_t k = 0; k < of.value.size(); ++k) {
            Entry one = entry_of("0017", 0);
            one.coefficients = {};
            one.coefficients[0] = Coefficient{of.value[k], of.u[k], of.u[k], of.u[k], 0, {}};
            const std::size_t hour = 48 * of.group[k] + 3 * k;
            one.started_utc_ns += static_cast<std::int64_t>(hour) * kHour_ns;
            one.ended_utc_ns = one.started_utc_ns + kHour_ns;
            history.push_back(one);
        }
        const Trend trend = trend_of(history, kShutdownAfterH, false);
        const CoefficientTrend& c = trend.coefficients.at(0);
        within += c.mean_low <= 3 && 3 <= c.mean_high;
    }
    return static_cast<double>(within) / kTrials;
}

TEST(Trend, TheMeansIntervalCoversAlsoWhereAFewCampaignsTellTheInstability) {
    constexpr double kLarge = 20 * kU;  // so that it shows in each history
    for (const std::size_t campaigns : {2U, 3U, 5U, 10U})
        EXPECT_NEAR(coverage(1, campaigns, kLarge, 0), 0.95, 0.03)
            << campaigns << " seed " << kSeed;
    EXPECT_NEAR(coverage(3, 1, 0, kLarge), 0.95, 0.03);
    EXPECT_NEAR(coverage(1, 5, 0, 0), 0.96, 0.04) << "nothing beyond the uncertainties";
}

TEST(Trend, PausesAreShutdowns) {
    std::vector<Entry> campaigns{entry_of("1", 0), entry_of("1", 0), entry_of("1", 1)};
    campaigns[1].started_utc_ns = campaigns[0].ended_utc_ns + kHour_ns;
    campaigns[1].ended_utc_ns = campaigns[1].started_utc_ns + kHour_ns;
    const auto found = trend_of(campaigns, kShutdownAfterH, false);
    EXPECT_THAT(found.turn, ::testing::ElementsAre(0, 0, 1));
    EXPECT_THAT(trend_of(campaigns, 0.5, false).turn, ::testing::ElementsAre(0, 1, 2));
}

TEST(Trend, NamesTheCampaignThatDoesNotFit) {
    std::mt19937 random(kSeed);
    std::normal_distribution<double> normal(0, kU);
    std::vector<Entry> campaigns;
    for (int i = 0; i < 12; ++i) {
        campaigns.push_back(entry_of("1", i, 0, kU));
        for (auto& c : campaigns.back().coefficients) c->value = 1 + normal(random);
    }
    campaigns[7].coefficients[13]->value += 30 * kU;
    campaigns.push_back(entry_of("1", 12));
    campaigns.back().verdict = "not valid";
    const auto found = trend_of(campaigns, kShutdownAfterH, false);
    EXPECT_EQ(found.left_out, 1U);
    for (const auto& of : found.coefficients)
        for (const auto& point : of.points)
            EXPECT_EQ(point.outlier, of.position == 13 && point.campaign == 7)
                << of.position << " " << point.campaign << ", seed " << kSeed;
}

TEST(Trend, SimulatedCampaignsAreNoHistoryOfARealUnit) {
    std::vector<Entry> campaigns;
    for (int i = 0; i < 5; ++i) {
        campaigns.push_back(entry_of("1", i, i < 3 ? 1 : 100));
        campaigns.back().simulated = i >= 3;
    }
    campaigns[1].verdict = "not valid";
    const auto real = trend_of(campaigns, kShutdownAfterH, false);
    EXPECT_FALSE(real.simulated);
    EXPECT_EQ(real.campaigns.size(), 2U);
    EXPECT_EQ(real.left_out, 1U);
    EXPECT_EQ(real.elsewhere, 2U);
    EXPECT_NEAR(real.coefficients.at(0).mean, 1, 1e-12);
    const auto simulated = trend_of(campaigns, kShutdownAfterH, true);
    EXPECT_TRUE(simulated.simulated);
    EXPECT_EQ(simulated.campaigns.size(), 2U);
    EXPECT_EQ(simulated.left_out, 0U);
    EXPECT_EQ(simulated.elsewhere, 3U);
    EXPECT_NEAR(simulated.coefficients.at(0).mean, 100, 1e-12);
}

/// A unit that has not changed: quadratic coefficients are 1 at 15 Hz and 4 at 25 Hz, the others 1.
std::vector<Entry> at_two_frequencies(std::mt19937& random, const std::vector<double>& hz) {
    std::normal_distribution<double> normal(0, kU);
    std::vector<Entry> made;
    for (std::size_t n = 0; n < hz.size(); ++n) {
        made.push_back(entry_of("1", static_cast<int>(n), 1, kU, hz[n]));
        for (std::size_t i = 0; i < estimator::kParameters; ++i)
            made.back().coefficients[i]->value =
                (hz[n] == 25 && estimator::is_quadratic(i) ? 4 : 1) + normal(random);
    }
    return made;
}

bool any_outlier(const Trend& trend) {
    for (const auto& of : trend.coefficients)
        if (std::ranges::any_of(of.points, &TrendPoint::outlier)) return true;
    return false;
}

TEST(Trend, QuadraticCoefficientsOfAnotherVibrationAreLeftOutAndCounted) {
    std::mt19937 random(kSeed);
    // GIVEN 11 campaigns at 15 Hz and 2 at 25 Hz of a unit that is the same all the time
    auto campaigns =
        at_two_frequencies(random, {15, 15, 15, 15, 25, 15, 15, 25, 15, 15, 15.005, 15, 15});
    const auto found = trend_of(campaigns, kShutdownAfterH, false);
    // THEN linear coefficients are compared over all of them, and nothing is an outlier
    EXPECT_FALSE(any_outlier(found)) << "seed " << kSeed;
    ASSERT_EQ(found.coefficients.size(), estimator::kParameters);
    EXPECT_EQ(found.coefficients[3].points.size(), 13U);
    EXPECT_EQ(found.coefficients[4].points.size(), 11U);
    EXPECT_EQ(found.coefficients[4].at_hz, 15.0);
    EXPECT_NEAR(found.coefficients[4].mean, 1, 0.2);
    EXPECT_EQ(found.of_other_vibration, 2U);
    EXPECT_THAT(found.vibrations, ::testing::ElementsAre("at 15 Hz"));
    EXPECT_THAT(found.other_vibrations, ::testing::ElementsAre("at 25 Hz"));
    // AND those at 25 Hz are there for whoever asks for them
    const auto other = trend_of(campaigns, kShutdownAfterH, false, all_at(25));
    EXPECT_EQ(other.coefficients[4].points.size(), 2U);
    EXPECT_EQ(other.of_other_vibration, 11U);
    EXPECT_EQ(other.coefficients[3].points.size(), 13U);
    // AND one that is like those of another frequency at its own does not fit
    campaigns[8].coefficients[4]->value = 4;
    EXPECT_TRUE(any_outlier(trend_of(campaigns, kShutdownAfterH, false)));
}

TEST(Trend, WhatIsNotNotedIsAVibrationOfItsOwn) {
    std::vector<Entry> campaigns{entry_of("1", 0, 1, kU, {}), entry_of("1", 1, 1, kU, {}),
                                 entry_of("1", 2, 1, kU, 0.0)};
    auto found = trend_of(campaigns, kShutdownAfterH, false);
    EXPECT_EQ(found.coefficients[4].points.size(), 1U);
    EXPECT_THAT(found.vibrations, ::testing::ElementsAre("static"));
    EXPECT_THAT(found.other_vibrations, ::testing::ElementsAre("of a vibration that is not noted"));
    campaigns.pop_back();
    found = trend_of(campaigns, kShutdownAfterH, false);
    EXPECT_EQ(found.coefficients[4].points.size(), 2U);
    EXPECT_EQ(found.of_other_vibration, 0U);
}

TEST(Trend, SaysThatWhatIsOfNoSingleFrequencyIsComparedWithNone) {
    // GIVEN a unit whose newest campaign was a random one
    const std::vector<Entry> campaigns{entry_of("1", 0, 1, kU, 15.0),
                                       entry_of("1", 1, 1, kU, kAtNoFrequency)};
    const auto found = trend_of(campaigns, kShutdownAfterH, false);
    EXPECT_EQ(found.coefficients.size(), 12U) << "bias and linear ones";
    EXPECT_EQ(vibration_words(found),
              "quadratic coefficients: at no single frequency, which are compared with none; those "
              "of 2 campaigns (at 15 Hz, at no single frequency) left out");
    // WHEN a frequency is asked for, that is what is there
    EXPECT_EQ(vibration_words(trend_of(campaigns, kShutdownAfterH, false, all_at(15))),
              "quadratic coefficients: at 15 Hz; those of 1 campaigns of another vibration (at no "
              "single frequency) left out");
}

TEST(Moved, AnotherFrequencyIsNoChangeOfTheUnitAndAChangeAtTheSameIs) {
    std::mt19937 random(kSeed);
    auto history =
        at_two_frequencies(random, {15, 15, 15, 15, 15, 15, 15, 15, 25, 25, 25, 25, 25, 25});
    Entry now = history.back();
    history.pop_back();
    EXPECT_TRUE(moved(now, history).empty()) << "seed " << kSeed;
    EXPECT_EQ(count_of_other_vibrations(now.coefficients, history), 8U);
    // The first at another frequency, or a survey's static ones: nothing to be held against.
    now.coefficients[4]->value = 100;
    now.coefficients[4]->at_hz = 0.0;
    EXPECT_TRUE(moved(now, history).empty());
    // At the same frequency it is one, and so is a linear one's at any.
    now.coefficients[4]->at_hz = 25.0;
    now.coefficients[2]->value = 100;
    const auto what = moved(now, history);
    ASSERT_EQ(what.size(), 2U);
    EXPECT_EQ(what[0].position, 2U);
    EXPECT_EQ(what[0].by.dof, 12);
    EXPECT_EQ(what[1].position, 4U);
    EXPECT_EQ(what[1].by.dof, 4);
}

/// A unit's life: a campaign a day, its coefficients scattered by `instability`.
std::vector<Entry> life(std::mt19937& random, int campaigns, double instability) {
    std::normal_distribution<double> normal;
    std::vector<Entry> made;
    for (int i = 0; i < campaigns; ++i) {
        made.push_back(entry_of("1", i, 0, kU));
        for (auto& c : made.back().coefficients)
            c->value = 5 + std::hypot(kU, instability) * normal(random);
    }
    return made;
}

TEST(Moved, OneCampaignIn1000IsCalledSoWithoutReason) {
    constexpr int kTrials = 4000;
    std::mt19937 random(kSeed);
    for (const double instability : {0.0, 3 * kU}) {
        int alarms = 0;
        for (int i = 0; i < kTrials; ++i) {
            auto history = life(random, 7, instability);
            const Entry now = history.back();
            history.pop_back();
            alarms += !moved(now, history).empty();
        }
        // Poisson with a mean of 4: 14 or more are one in 7000.
        EXPECT_LE(alarms, 13) << "instability " << instability << ", seed " << kSeed;
    }
}

TEST(Moved, AStepIsFoundAndInstabilityOfTheHistoryIsAllowed) {
    std::mt19937 random(kSeed);
    int found = 0, allowed = 0;
    constexpr int kTrials = 100;
    for (int i = 0; i < kTrials; ++i) {
        for (const double instability : {0.0, 10 * kU}) {
            auto history = life(random, 13, instability);
            Entry now = history.back();
            history.pop_back();
            now.coefficients[2]->value = 5 + 15 * kU;
            const auto what = moved(now, history);
            if (instability > 0) {
                allowed += what.empty();
            } else {
                found += what.size() == 1 && what[0].position == 2;
            }
        }
    }
    EXPECT_GE(found, 99) << "seed " << kSeed;
    EXPECT_GE(allowed, 95) << "seed " << kSeed;
}

TEST(Moved, SaysNothingWithoutAHistory) {
    Entry now = entry_of("1", 2, 1000);
    EXPECT_TRUE(moved(now, {}).empty());
    EXPECT_TRUE(moved(now, {entry_of("1", 0)}).empty());
    // Later ones, those of a program, and bad ones are none.
    auto later = entry_of("1", 3), other = entry_of("1", 0), bad = entry_of("1", 1);
    other.simulated = true;
    bad.verdict = "not valid";
    EXPECT_TRUE(moved(now, {later, other, bad, entry_of("1", 1)}).empty());
}

}  // namespace
}  // namespace vibrig::archive
