#include "estimator/spectrum/controller_psd.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include "estimator/spectrum/table.hpp"

namespace vibrig::estimator::spectrum {
namespace {

using Pairs = std::vector<std::array<double, 2>>;
using ::testing::HasSubstr;

/// Flat from 20 to 120 Hz, 1 g^2: 60 s of it know the mean square to 1/sqrt(100 * 60) = 1.3 %.
PsdExpected flat() {
    PsdExpected expected;
    expected.nominal = {"broad", {{20, 0.01}, {120, 0.01}}, {}, {0, 1, 0}, 0};
    expected.measured_g_rms = 1;
    expected.seconds = 60;
    return expected;
}

/// As a controller with lines of 1 Hz has it, and room for 20 more.
Pairs reported() {
    Pairs pairs;
    for (int i = 0; i <= 100; ++i) pairs.push_back({20.0 + i, i % 2 == 0 ? 0.0102 : 0.0098});
    pairs.resize(pairs.size() + 20);
    return pairs;
}

std::string refused(const std::function<void(Pairs&)>& spoil, PsdExpected expected = flat()) {
    Pairs pairs = reported();
    spoil(pairs);
    return take_controller_psd(pairs, expected).wrong;
}

TEST(ControllerPsd, IsTakenAsItCame) {
    const auto taken = take_controller_psd(reported(), flat());
    EXPECT_EQ(taken.wrong, "");
    ASSERT_EQ(taken.psd.psd.size(), 101U);
    EXPECT_EQ(taken.psd.psd[1], (std::pair<double, double>{21, 0.0098}));
    EXPECT_NEAR(mean_square(taken.psd), 1, 1e-3);
    check(taken.psd);
}

TEST(ControllerPsd, NumbersThatAreNoneAreRefusedWithTheirPlace) {
    const double nan = std::nan(""), infinite = std::numeric_limits<double>::infinity();
    EXPECT_EQ(refused([&](Pairs& p) { p[17][1] = nan; }),
              "psd_block[17]: found nan g^2/Hz at 37 Hz, expected 0 or above");
    EXPECT_EQ(refused([&](Pairs& p) { p[17][1] = infinite; }),
              "psd_block[17]: found inf g^2/Hz at 37 Hz, expected 0 or above");
    EXPECT_EQ(refused([&](Pairs& p) { p[3][1] = -0.01; }),
              "psd_block[3]: found -0.01 g^2/Hz at 23 Hz, expected 0 or above");
    EXPECT_EQ(refused([&](Pairs& p) { p[3][0] = nan; }),
              "psd_block[3]: found nan Hz, expected a frequency above 0");
    EXPECT_EQ(refused([&](Pairs& p) { p[0][0] = 0; }),
              "psd_block[0]: found 0 Hz, expected a frequency above 0");
}

TEST(ControllerPsd, FrequenciesHaveToRise) {
    EXPECT_EQ(refused([](Pairs& p) { p[5][0] = p[4][0]; }),
              "psd_block[5]: found 24 Hz after 24 Hz, expected rising frequencies");
    EXPECT_EQ(refused([](Pairs& p) { std::swap(p[5], p[6]); }),
              "psd_block[6]: found 25 Hz after 26 Hz, expected rising frequencies");
}

TEST(ControllerPsd, TooLittleOfItIsRefused) {
    EXPECT_THAT(refused([](Pairs& p) { std::ranges::fill(p, std::array<double, 2>{}); }),
                HasSubstr("found 0 lines before the zeros at its end, expected 2 at least"));
    EXPECT_THAT(refused([](Pairs& p) {
                    for (auto& pair : p) pair[1] = 0;
                }),
                HasSubstr("found no power"));
    EXPECT_THAT(refused([](Pairs& p) { p.clear(); }), HasSubstr("found 0 lines"));
    // Half of the profile's power lies beyond, whatever the half that is there adds up to.
    EXPECT_THAT(refused([](Pairs& p) {
                    p.resize(51);
                    for (auto& pair : p) pair[1] *= 2;
                }),
                HasSubstr("found lines from 20 to 70 Hz, expected those of the profile"));
}

TEST(ControllerPsd, WhatDoesNotChangeIsOfAnotherDwell) {
    const Pairs before = reported();
    PsdExpected expected = flat();
    expected.before = before;
    EXPECT_THAT(take_controller_psd(before, expected).wrong, HasSubstr("to the last bit"));
    Pairs now = before;
    now[7][1] += 1e-9;
    EXPECT_EQ(take_controller_psd(now, expected).wrong, "");
}

/// Four standard errors of two mean squares that are each known to 1.29 % and 1 %: 9.24 %.
TEST(ControllerPsd, ItsRmsIsTheControllersOwnAndAboutTheProfiles) {
    PsdExpected expected = flat();
    expected.measured_g_rms = std::sqrt(1 / 1.08);
    EXPECT_EQ(refused([](Pairs&) {}, expected), "");
    expected.measured_g_rms = std::sqrt(1 / 1.11);
    EXPECT_THAT(refused([](Pairs&) {}, expected), HasSubstr("of measured_g_rms within 0.092"));
    expected.measured_g_rms = 0;  // nobody said
    EXPECT_THAT(refused(
                    [](Pairs& p) {
                        for (auto& pair : p) pair[1] *= 2.1;
                    },
                    expected),
                HasSubstr("expected the profile's 1 g within 3 dB"));
}

TEST(ControllerPsd, AnotherShapeOfTheSameRmsIsAnotherProfiles) {
    // All of it in a fifth of the band.
    EXPECT_THAT(refused([](Pairs& p) {
                    for (std::size_t i = 0; i < 101; ++i) p[i][1] = i < 20 ? 0.05 : 1e-6;
                }),
                HasSubstr("found another shape"));
    // 3 dB up and down by halves is none.
    EXPECT_EQ(refused([](Pairs& p) {
                  for (std::size_t i = 0; i < 101; ++i) p[i][1] = i < 33 ? 0.02 : 0.005;
              }),
              "");
}

/// It is the dwell's own: its kind keeps the profile's shape for the others.
TEST(ControllerPsd, WeighsTheElasticPartOfItsDwell) {
    const Resonance at{60, 0.05};
    const Kind kind{"broad", bands_of(flat().nominal)};
    const auto own = bands_of(Profile{"", {{20, 0.02}, {70, 0.02}}, {}, {0, 1, 0}, 0}, 100);
    std::vector<SpectralDwell> dwells(3);
    for (SpectralDwell& dwell : dwells) {
        dwell.kind = 0;
        dwell.row.vibration.kappa = 2;
        dwell.row.random = true;
    }
    dwells[1].bands = own;
    const SpectralTable table(Settings{}, dwells, {kind});
    const Eigen::VectorXd weights = table.elastic_weights(at);
    EXPECT_DOUBLE_EQ(weights[0], elastic_weight(kind.bands, at));
    EXPECT_DOUBLE_EQ(weights[1], elastic_weight(own, at));
    EXPECT_DOUBLE_EQ(weights[2], weights[0]);
    EXPECT_GT(std::abs(weights[1] - weights[0]), 0.1);
}

}  // namespace
}  // namespace vibrig::estimator::spectrum
