#include "estimator/uncertainty/monte_carlo.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "estimator/uncertainty/leverage.hpp"
#include "tests/unit/estimator/uncertainty/theory_rows.hpp"

namespace vibrig::estimator::uncertainty {
namespace {

struct Clean {
    explicit Clean(const Settings& s = {})
        : settings(s),
          result(estimator::testing::result_of(
              estimator::testing::theory_rows(s, estimator::testing::balanced(6, 14.0 / 3)))),
          assessed(assess(s, result)) {}
    Settings settings;
    Result result;
    Assessment assessed;
};

TEST(MonteCarlo, ConfirmsTheBudgetOfACleanRigToOneDigit) {
    const Clean rig;
    MonteCarloSettings how;
    how.most_blocks = 100;
    const MonteCarlo drawn = propagate_distributions(rig.settings, rig.result, rig.assessed, how);
    SCOPED_TRACE("seed " + std::to_string(how.seed));
    EXPECT_TRUE(drawn.stable) << drawn.blocks;
    EXPECT_TRUE(drawn.gum_confirmed) << drawn.largest_difference;
    for (std::size_t i = 0; i < kParameters; ++i) {
        const auto& c = rig.assessed.coefficients[i];
        // u within what 65 blocks of 1e4 leave of it, and the tolerance of one digit.
        EXPECT_NEAR(drawn.coefficients[i].u / c.u, 1, 0.01) << parameter_names()[i];
        EXPECT_LT(drawn.coefficients[i].low, c.value);
        EXPECT_GT(drawn.coefficients[i].high, c.value);
    }
    EXPECT_LT(drawn.nonlinearity, 0.01);
}

TEST(MonteCarlo, FindsTheIntervalWhereARectangleDominates) {
    // GIVEN a gain that is known to 5 % only, rectangular: squares and products are all gain
    Settings settings;
    settings.uncertainty.accelerometer_gain = {0.05, Shape::rectangular};
    const Clean rig(settings);
    MonteCarloSettings how;
    how.most_blocks = 10;
    const MonteCarlo drawn = propagate_distributions(settings, rig.result, rig.assessed, how);
    // THEN 95 % lie within 0.95 sqrt 3 u, not 1.96 u: the budget is not confirmed
    EXPECT_FALSE(drawn.gum_confirmed);
    const auto& c = rig.assessed.coefficients[6];
    const double half = 0.5 * (drawn.coefficients[6].high - drawn.coefficients[6].low);
    EXPECT_NEAR(half / c.u, 0.95 * std::sqrt(3.0), 0.05);
}

TEST(MonteCarlo, RefusesWhatWasNotAssessed) {
    EXPECT_THROW(static_cast<void>(propagate_distributions({}, {}, {})), SettingsError);
}

TEST(Leverage, NamesThePartThatShrinksTheSquaresMost) {
    Settings settings;
    settings.uncertainty.accelerometer_gain = {0.02, Shape::rectangular};
    const Clean rig(settings);
    const auto list = leverages(rig.assessed);
    ASSERT_GT(list.size(), 3U);
    const auto best = std::min_element(
        list.begin(), list.end(),
        [](const Leverage& a, const Leverage& b) { return a.without[2] < b.without[2]; });
    EXPECT_EQ(best->input, "accelerometer_gain");
    EXPECT_EQ(kind_name(best->strongest()), std::string("squares"));
    EXPECT_NE(advice(*best).find("gain at the vibration's frequency"), std::string::npos);
    EXPECT_NE(advice(*best).find("not declared"), std::string::npos);
    // Without the gain u of the squares is that of a rig without this input.
    settings.uncertainty.accelerometer_gain.u = 0;
    const Clean without(settings);
    double sum = 0, count = 0;
    for (std::size_t i = 0; i < kParameters; ++i) {
        if (kind_of(i) != 2) continue;
        const double ratio = without.assessed.coefficients[i].u / rig.assessed.coefficients[i].u;
        sum += ratio * ratio;
        ++count;
    }
    EXPECT_NEAR(best->without[2], std::sqrt(sum / count), 0.01);
}

}  // namespace
}  // namespace vibrig::estimator::uncertainty
