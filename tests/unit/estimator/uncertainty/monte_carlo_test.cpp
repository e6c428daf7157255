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

/// The end that a share of `tail` lies beyond, of a normal variable and a rectangular one together.
double end_of(double normal_u, double rectangular_u, double tail) {
    const double half_width = std::sqrt(3.0) * rectangular_u;
    double low = 0, high = 10 * (normal_u + rectangular_u);
    while (high - low > 1e-9 * normal_u) {
        const double end = 0.5 * (low + high);
        constexpr int kParts = 1000;
        double beyond = 0;
        for (int k = 0; k < kParts; ++k) {
            const double x = half_width * (2 * (k + 0.5) / kParts - 1);
            beyond += 0.5 * std::erfc((end - x) / normal_u / std::sqrt(2.0)) / kParts;
        }
        (beyond > tail ? low : high) = end;
    }
    return low;
}

TEST(MonteCarlo, KnowsTheEndsToATenthOfWhatTheyAreHeldTo) {
    // GIVEN squares and products, of which all but the gain is as good as normal, and ends far out
    Settings settings;
    settings.uncertainty.coverage = 0.99;
    const Clean rig(settings);
    const MonteCarloSettings how;
    const MonteCarlo drawn = propagate_distributions(rig.settings, rig.result, rig.assessed, how);
    EXPECT_TRUE(drawn.stable) << drawn.blocks;
    for (std::size_t i = 0; i < kParameters; ++i) {
        if (kind_of(i) < 2) continue;
        const Coefficient& c = rig.assessed.coefficients[i];
        const auto gain =
            std::ranges::find(c.budget, std::string("accelerometer_gain"), &Contribution::input);
        ASSERT_NE(gain, c.budget.end());
        const double rectangular = gain->contribution;
        const double end =
            end_of(std::sqrt(c.u * c.u - rectangular * rectangular), rectangular, 0.005);
        // THEN each end is where it is by that, within 4 standard errors of a tenth of the
        // tolerance (JCGM 101, 8.2: twice the standard error within a fifth of it)
        const double near = 4 * 0.1 * numerical_tolerance(c.u, how.digits);
        EXPECT_NEAR(c.value - drawn.coefficients[i].low, end, near)
            << "seed " << how.seed << ", " << drawn.blocks << " blocks, " << parameter_names()[i];
        EXPECT_NEAR(drawn.coefficients[i].high - c.value, end, near)
            << "seed " << how.seed << ", " << drawn.blocks << " blocks, " << parameter_names()[i];
    }
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

TEST(MonteCarlo, DrawsLocalGravityFromItsShape) {
    // GIVEN gravity that is known to 5 % only, rectangular: D_I of 1 deg/h/g is all of it
    Settings settings;
    settings.uncertainty.local_g = {0.05, Shape::rectangular};
    const Clean rig(settings);
    MonteCarloSettings how;
    how.most_blocks = 10;
    SCOPED_TRACE("seed " + std::to_string(how.seed));
    const MonteCarlo drawn = propagate_distributions(settings, rig.result, rig.assessed, how);
    // THEN 95 % lie within 0.95 sqrt 3 u, and the budget's 1.96 u is not confirmed
    EXPECT_FALSE(drawn.coefficients[1].confirmed);
    const auto& c = rig.assessed.coefficients[1];
    ASSERT_GT(settings.uncertainty.local_g.u * std::abs(c.value), 0.99 * c.u);
    const double half = 0.5 * (drawn.coefficients[1].high - drawn.coefficients[1].low);
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

/// Latitude and azimuth known to 300 arcsec each, correlated.
Settings correlated_sites(double correlation, double latitude_arcsec = 300) {
    Settings settings;
    settings.uncertainty.latitude_arcsec.u = latitude_arcsec;
    settings.uncertainty.azimuth_arcsec.u = 300;
    settings.uncertainty.correlations = {{"latitude", "azimuth", correlation}};
    return settings;
}

TEST(Leverage, KnowsThatInputsAreCorrelated) {
    for (const double correlation : {-0.99, 0.6}) {
        const Clean rig(correlated_sites(correlation)), without(correlated_sites(correlation, 0));
        const auto list = leverages(rig.assessed);
        const auto latitude = std::ranges::find(list, std::string("latitude"), &Leverage::input);
        ASSERT_NE(latitude, list.end());
        for (std::size_t kind = 0; kind < kKinds; ++kind) {
            double sum = 0, count = 0;
            for (std::size_t i = 0; i < kParameters; ++i) {
                if (kind_of(i) != kind) continue;
                const double ratio =
                    without.assessed.coefficients[i].u / rig.assessed.coefficients[i].u;
                sum += ratio * ratio;
                ++count;
            }
            // THEN without the latitude u is that of a rig whose latitude is certain
            EXPECT_NEAR(latitude->without[kind], std::sqrt(sum / count), 1e-6)
                << correlation << " " << kind_name(kind);
        }
    }
}

}  // namespace
}  // namespace vibrig::estimator::uncertainty
