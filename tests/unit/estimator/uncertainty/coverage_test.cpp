#include "estimator/uncertainty/coverage.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "estimator/filter/parameters.hpp"

namespace vibrig::estimator::uncertainty {
namespace {

using Eigen::Index;

Eigen::VectorXd some_values() { return Eigen::VectorXd::LinSpaced(kParameters, 0.1, 3.0); }

TEST(Coverage, GravityMovesLinearTermsOnceAndQuadraticOnesTwice) {
    const Eigen::VectorXd value = some_values(), c = per_gravity(value);
    for (std::size_t group = 0; group < kGroups; ++group) {
        for (std::size_t j = 0; j < kGyros; ++j) {
            const auto i = static_cast<Index>(internal_index(group, j));
            const double power = group == kDt ? 0 : group <= kDo ? 1 : 2;
            EXPECT_EQ(c[i], power * value[i]) << group;
        }
    }
}

TEST(Coverage, TheBudgetHasTheCovarianceOfWhatNoDwellShows) {
    Inputs inputs;
    inputs.local_g = {2e-3};
    inputs.sync_motion = SyncMotionOf::platform;
    constexpr double kBound = 5e-3;
    const Eigen::MatrixXd p = unseen_covariance(inputs, some_values(), kBound);
    for (std::size_t i = 0; i < kParameters; ++i) {
        std::vector<Contribution> budget;
        add_unseen(inputs, some_values(), kBound, i, budget);
        double square = 0;
        for (const auto& part : budget) square += part.contribution * part.contribution;
        EXPECT_NEAR(square, p(static_cast<Index>(i), static_cast<Index>(i)), 1e-15) << i;
    }
    // Gravity is one quantity: what it does to two coefficients goes together; motion's bounds do
    // not.
    const auto a = static_cast<Index>(internal_index(kDii, 0)),
               b = static_cast<Index>(internal_index(kDss, 1));
    EXPECT_NEAR(p(a, b), 4e-6 * 4 * some_values()[a] * some_values()[b], 1e-15);
    // Where the platform is said to stand still, or nobody said it moves, nothing is added.
    inputs.sync_motion = SyncMotionOf::warn;
    EXPECT_LT(unseen_covariance(inputs, some_values(), kBound)(a, a), p(a, a));
}

Coefficient of_parts(double noise, double part, double dof) {
    Coefficient c;
    c.noise = c.u_a = noise;
    c.u_b = part;
    c.u = std::hypot(noise, part);
    c.budget = {{"noise and drift states", "", 1, noise, noise, Shape::normal,
                 std::numeric_limits<double>::infinity(), true},
                {"gain", "", 1, part, part, Shape::normal, dof, true}};
    return c;
}

TEST(Coverage, UIsStudentsByTheDegreesOfFreedomOfWhatIsLargest) {
    Inputs inputs;
    inputs.noise_dof = std::numeric_limits<double>::infinity();
    // Student's factors for 95 % (two sides): 4 degrees 2.776, 20 degrees 2.086.
    for (const auto& [dof, k] : {std::pair{4.0, 2.776}, {20.0, 2.086}}) {
        Coefficient c = of_parts(1e-6, 1, dof);
        expand(inputs, 0, 10, 0, c);
        EXPECT_NEAR(c.nu_eff, dof, 1e-6);
        EXPECT_NEAR(c.k, k, 1e-3);
        EXPECT_NEAR(c.expanded, k, 2e-3);
        EXPECT_EQ(c.budget.front().input, "gain") << "the largest first";
        EXPECT_TRUE(std::isnan(c.u_use)) << "nobody has said how it repeats";
    }
}

TEST(Coverage, WhatTheSpreadOfTheDwellsSaysHasTheDegreesTheySpare) {
    Inputs inputs;
    inputs.noise_dof = 1e9;
    Coefficient c = of_parts(1, 0, 1);
    c.budget.pop_back();
    c.noise = 1e-6;  // all of u_a is from what the rates scatter
    expand(inputs, 0, 4, 0, c);
    EXPECT_NEAR(c.nu_eff, 4, 1e-6);
    EXPECT_NEAR(c.k, 2.776, 1e-3);
    // As many dwells as coefficients: one degree, not none.
    expand(inputs, 0, 0, 0, c);
    EXPECT_NEAR(c.k, 12.706, 1e-3);
}

TEST(Coverage, AnotherPowerOnAddsItsOwnScatterToBiasAndLinearTerms) {
    Inputs inputs;
    inputs.turn_on_bias = Declared{0.3};
    inputs.turn_on_linear = Declared{0.04};
    const auto u_use = [&](Group group, double ramp) {
        Coefficient c = of_parts(0.1, 0.1, 10);
        expand(inputs, internal_index(group, 1), 10, ramp, c);
        return c.u_use;
    };
    const double u = std::hypot(0.1, 0.1);
    EXPECT_NEAR(u_use(kDt, 0), std::hypot(u, 0.3), 1e-12);
    EXPECT_NEAR(u_use(kDo, 7), std::hypot(u, 0.04), 1e-12);
    EXPECT_NEAR(u_use(kDss, 7), u, 1e-12);
    // A ramp that was seen in the dwells, unless one is declared: half of it either way,
    // rectangular.
    EXPECT_NEAR(u_use(kDt, 0.6), std::sqrt(u * u + 0.09 + 0.03), 1e-12);
    inputs.ramp_in_dwell = Declared{0.0};
    EXPECT_NEAR(u_use(kDt, 0.6), std::hypot(u, 0.3), 1e-12);
    // WHEN one of them alone is stated THEN it is known of that
    inputs.turn_on_linear.reset();
    EXPECT_NEAR(u_use(kDt, 0), std::hypot(u, 0.3), 1e-12);
    EXPECT_TRUE(std::isnan(u_use(kDo, 0)) && std::isnan(u_use(kDss, 0)));
    inputs.turn_on_linear = Declared{0.04};
    inputs.turn_on_bias.reset();
    EXPECT_NEAR(u_use(kDo, 0), std::hypot(u, 0.04), 1e-12);
    EXPECT_TRUE(std::isnan(u_use(kDt, 0)) && std::isnan(u_use(kDss, 0)));
}

TEST(Coverage, ARampGrowsAsLongAsTheDwellLasts) {
    std::vector<DwellRow> rows(2);
    EXPECT_EQ(growth_in_dwell(0.3, {}), 0);
    for (DwellRow& row : rows) row.duration_s = 100;
    EXPECT_DOUBLE_EQ(growth_in_dwell(0.3, rows), 0.3) << "it is stated per 100 s";
    rows[0].duration_s = 500;
    EXPECT_DOUBLE_EQ(growth_in_dwell(0.3, rows), 0.9);
    EXPECT_DOUBLE_EQ(growth_in_dwell(-0.3, rows), -0.9);
}

}  // namespace
}  // namespace vibrig::estimator::uncertainty
