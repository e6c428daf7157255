#include "estimator/spectrum/about.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "estimator/spectrum/sampling.hpp"

namespace vibrig::estimator::spectrum {
namespace {

using Mixtures = std::array<std::vector<Hypothesis>, 3>;
constexpr Sampling kFast{1000, 10}, kForty{40, 10};

Hypothesis one_at(std::vector<Resonance> resonances, double weight = 1) {
    Hypothesis one;
    one.weight = weight;
    one.resonances = std::move(resonances);
    return one;
}
Mixtures common(const Resonance& of) { return {{{one_at({of})}, {one_at({of})}, {one_at({of})}}}; }
std::string about_complaint(const Mixtures& mixtures, const Sampling& sampling = kFast) {
    try {
        static_cast<void>(about_resonances(mixtures, sampling, {15}));
    } catch (const plan::PlanError& error) {
        return error.what();
    }
    return "";
}

/// d rho/d f = 0 at r^2 = 1 -+ 2 zeta.
TEST(About, OfAResonanceThatIsKnownTheTwoExtremes) {
    for (const Resonance& of : {Resonance{60, 0.05}, {97, 0.1}, {41, 0.02}, {300, 0.15}}) {
        const auto about = about_resonances(common(of), kFast, {15});
        ASSERT_EQ(about.size(), 3U);
        for (const About& one : about) {
            EXPECT_NEAR(one.resonance_hz, of.hz, 1e-9);
            EXPECT_NEAR(one.below_hz, of.hz * std::sqrt(1 - 2 * of.damping), 0.05 + 1e-9);
            EXPECT_NEAR(one.above_hz, of.hz * std::sqrt(1 + 2 * of.damping), 0.05 + 1e-9);
        }
        EXPECT_EQ(frequencies_of(about).size(), 2U) << "one pair for all";
    }
}

TEST(About, AlwaysOnBothSidesFreeAndApart) {
    for (unsigned seed = 1; seed <= 40; ++seed) {
        std::mt19937_64 random(seed);
        std::uniform_real_distribution<double> log_hz(std::log(22), std::log(180)),
            log_damping(std::log(0.005), std::log(0.2));
        std::normal_distribution<double> normal;
        const Sampling sampling = seed % 2 == 0 ? kForty : Sampling{100, 10};
        Mixtures mixtures;
        for (auto& mixture : mixtures) {
            const double hz = std::exp(log_hz(random)), damping = std::exp(log_damping(random));
            for (int k = 0; k < 50; ++k)
                mixture.push_back(one_at({{hz * (1 + 0.002 * normal(random)), damping}}, 0.02));
        }
        const auto about = about_resonances(mixtures, sampling, {15.1});
        ASSERT_EQ(about.size(), 3U);
        for (const About& one : about) {
            EXPECT_LT(one.below_hz, one.resonance_hz) << "seed " << seed;
            EXPECT_GT(one.above_hz, one.resonance_hz) << "seed " << seed;
            for (const double hz : {one.below_hz, one.above_hz})
                EXPECT_FALSE(forbidden(hz, sampling.sample_hz, 10, kHarmonicsPlanned))
                    << "seed " << seed << ": " << hz;
        }
        // And a survey takes them as they are.
        std::vector<double> all = frequencies_of(about);
        all.insert(all.begin(), 15.1);
        const auto lines = survey_lines(all, 6, sampling, {true, {}, {}}, {});
        for (std::size_t k = 0; k < all.size(); ++k) EXPECT_EQ(lines[k].hz, all[k]);
    }
}

/// 60 Hz is forbidden at 40/s, and so are 60 +- 0.4; the extremes of a damping of 0.003 lie there.
TEST(About, OffWhatIsForbiddenAndOnItsSide) {
    const auto about = about_resonances(common({60, 0.003}), kForty, {15});
    EXPECT_LE(about[0].below_hz, 60 / 1.01);
    EXPECT_GE(about[0].above_hz, 60 * 1.01);
    EXPECT_GT(about[0].below_hz, 57);
    EXPECT_LT(about[0].above_hz, 63);
}

TEST(About, AFrequencyThatIsPlannedServesForANeighbour) {
    Mixtures mixtures = common({60, 0.05});
    mixtures[2] = {one_at({{61, 0.05}})};
    EXPECT_EQ(frequencies_of(about_resonances(mixtures, kFast, {15})).size(), 2U);
    // The reference frequency too, but none on the other side.
    const auto about = about_resonances(common({60, 0.05}), kFast, {57.2});
    EXPECT_EQ(about[0].below_hz, 57.2);
    EXPECT_NEAR(about[0].above_hz, 62.9, 1e-9);
    mixtures[2] = {one_at({{90, 0.05}})};
    EXPECT_EQ(frequencies_of(about_resonances(mixtures, kFast, {15})).size(), 4U);
    // Two of one gyro.
    mixtures = {{{one_at({})}, {one_at({{40, 0.05}, {95, 0.05}})}, {one_at({})}}};
    const auto two = about_resonances(mixtures, kFast, {15});
    ASSERT_EQ(two.size(), 2U);
    EXPECT_EQ(two[0].gyro, 1U);
    EXPECT_NEAR(two[1].above_hz, 95 * std::sqrt(1.1), 0.05);
}

/// Where the resonance is known to 2 Hz, the best place is farther off than of one that is known.
TEST(About, WhatIsHardlyKnownIsLookedAtFromFarther) {
    Mixtures mixtures;
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal;
    for (auto& mixture : mixtures)
        for (int k = 0; k < 200; ++k)
            mixture.push_back(one_at({{60 + 2 * normal(random), 0.02}}, 0.005));
    const auto about = about_resonances(mixtures, kFast, {15});
    EXPECT_LT(about[0].below_hz, 60 * std::sqrt(1 - 0.04) - 0.5);
    EXPECT_GT(about[0].above_hz, 60 * std::sqrt(1 + 0.04) + 0.5);
}

TEST(About, NothingNamedIsSaid) {
    const std::string none = "found no gyro whose elastic part is named";
    Mixtures flat{{{one_at({})}, {one_at({})}, {one_at({})}}};
    EXPECT_NE(about_complaint(flat).find(none), std::string::npos) << about_complaint(flat);
    // Log odds of 4 are 0.982.
    flat[0] = {one_at({{60, 0.05}}, 0.981), one_at({}, 0.019)};
    EXPECT_NE(about_complaint(flat).find(none), std::string::npos);
    flat[0] = {one_at({{60, 0.05}}, 0.983), one_at({}, 0.017)};
    EXPECT_EQ(about_complaint(flat), "");
}

}  // namespace
}  // namespace vibrig::estimator::spectrum
