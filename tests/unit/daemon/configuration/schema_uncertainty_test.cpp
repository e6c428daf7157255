#include <algorithm>
#include <cmath>
#include <string>

#include "tests/unit/daemon/configuration/support.hpp"

// What is declared of a rig: a budget that is none has no place in a result.

namespace vibrig::configuration {
namespace {

using estimator::uncertainty::Misfit;
using ::testing::EndsWith;
using ::testing::HasSubstr;

TEST(DeclaredInputs, ThatAreNoBudgetAreRefusedByKeyAndValue) {
    const auto said = [](const std::string& line) { return complaint("[uncertainty]\n" + line); };
    EXPECT_THAT(said("latitude_arcsec = -1"), HasSubstr("uncertainty.latitude_arcsec"));
    EXPECT_THAT(said("azimuth_arcsec = nan"), HasSubstr("uncertainty.azimuth_arcsec"));
    EXPECT_THAT(said("azimuth_arcsec = { u = 5, shape = \"round\" }"), HasSubstr("\"round\""));
    EXPECT_THAT(said("time_base = { u = 1e-5, half_width = 1e-5, shape = \"rectangular\" }"),
                HasSubstr("both u and half_width"));
    EXPECT_THAT(said("correlation = [[\"latitude\", \"azimuth\", 1.5]]"),
                HasSubstr("uncertainty.correlation[0][2]"));
    EXPECT_THAT(said("encoder_zero_arcsec = [1, 2]"), HasSubstr("uncertainty.encoder_zero_arcsec"));
}

TEST(DeclaredInputs, WhatNobodyStatedIsShownAndStaysUndeclared) {
    const auto shown = [](const Loaded& loaded) {
        const auto at = std::ranges::find(loaded.effective, "uncertainty.resolver_harmonics",
                                          &EffectiveValue::key);
        return at == loaded.effective.end() ? "" : at->value;
    };
    const Loaded silent = parse("", "rig.toml", false);
    EXPECT_THAT(shown(silent), HasSubstr("{ order = 16, arcsec = 3.0, declared = false }"));
    const auto again = [&shown](const Loaded& loaded) {
        return accepted("uncertainty.resolver_harmonics = " + shown(loaded)).estimator.uncertainty;
    };
    EXPECT_FALSE(again(silent).resolver_harmonics_declared);
    EXPECT_EQ(again(silent).resolver_harmonics.size(), 3U);
    const std::string stated = "uncertainty.resolver_harmonics = [{ order = 2, arcsec = 1 }]";
    EXPECT_TRUE(again(parse(stated, "rig.toml", false)).resolver_harmonics_declared);
    EXPECT_TRUE(accepted("uncertainty.resolver_harmonics = []")
                    .estimator.uncertainty.resolver_harmonics_declared);
    EXPECT_THAT(complaint("uncertainty.resolver_harmonics = [{ order = 2, arcsec = 1, u = 3 }]"),
                HasSubstr("uncertainty.resolver_harmonics[0]"));
    EXPECT_THAT(complaint("uncertainty.resolver_harmonics = [{ order = 0, arcsec = 1 }]"),
                HasSubstr("uncertainty.resolver_harmonics[0].order: found 0, expected"));
    // Both at once would be taken for one that is larger than either.
    EXPECT_THAT(complaint("uncertainty.resolver_harmonics = "
                          "[{ order = 16, arcsec = 3 }, { order = 16, arcsec = 4 }]"),
                HasSubstr("uncertainty.resolver_harmonics[1]: found order 16 once more, expected "
                          "each order once"));
}

TEST(DeclaredInputs, ForAnotherPowerOnAreNumbersOrTables) {
    const auto inputs = [](const std::string& text) {
        return accepted("[uncertainty]\n" + text).estimator.uncertainty;
    };
    const auto stated = inputs(
        "turn_on_bias = 0.05\n"
        "turn_on_linear = { half_width = 0.6, shape = \"triangular\" }\n"
        "ramp_in_dwell = { half_width = 0.3, shape = \"rectangular\", dof = 5 }");
    ASSERT_TRUE(stated.turn_on_bias && stated.turn_on_linear && stated.ramp_in_dwell);
    EXPECT_EQ(stated.turn_on_bias->u, 0.05);
    EXPECT_NEAR(stated.turn_on_linear->u, 0.6 / std::sqrt(6.0), 1e-12);
    EXPECT_NEAR(stated.ramp_in_dwell->u, 0.3 / std::sqrt(3.0), 1e-12);
    const auto silent = inputs("");
    EXPECT_FALSE(silent.turn_on_bias || silent.turn_on_linear || silent.ramp_in_dwell);
    EXPECT_THAT(complaint("[uncertainty]\nramp_in_dwell = { u = 1, dof = 0 }"),
                EndsWith("dof: found 0, expected a number from 1 to 1e+09"));
    EXPECT_THAT(complaint("[uncertainty]\nramp_in_dwell = -0.1"),
                HasSubstr("uncertainty.ramp_in_dwell: found -0.1"));
}

TEST(FreedClasses, AreNamedAsTheVerdictNamesThem) {
    const auto c = accepted("[estimator]\nfree = [\"azimuth\", \"resolver, 16 per turn\"]");
    EXPECT_EQ(c.estimator.free, (std::vector<Misfit>{Misfit::azimuth, Misfit::resolver_16}));
    EXPECT_TRUE(accepted("").estimator.free.empty());
}

TEST(FreedClasses, ThatAreUnknownOrThereTwiceAreRefused) {
    const std::string unknown = complaint("[estimator]\nfree = [\"azimut\"]");
    EXPECT_THAT(unknown, HasSubstr("estimator.free[0]"));
    EXPECT_THAT(unknown, HasSubstr("\"azimuth\""));
    EXPECT_THAT(complaint("[estimator]\nfree = [\"step\"]"), HasSubstr("estimator.free[0]"));
    EXPECT_THAT(complaint("[estimator]\nfree = [\"latitude\", \"latitude\"]"),
                HasSubstr("estimator.free[1]"));
    EXPECT_THAT(complaint("[estimator]\nfree = [3]"), HasSubstr("estimator.free[0]"));
}

}  // namespace
}  // namespace vibrig::configuration
