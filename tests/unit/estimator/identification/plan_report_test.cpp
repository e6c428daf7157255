#include "estimator/identification/plan_report.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "tests/unit/estimator/identification/identified.hpp"

namespace vibrig::estimator::testing {
namespace {

constexpr double kPlanPeriod_s = 0.025;

std::vector<std::array<double, 3>> positions(std::size_t count) {
    return {kTable1.begin(), kTable1.begin() + static_cast<std::ptrdiff_t>(count)};
}

TEST(PlanReport, TwoLevelsOverTable1DetermineEverythingAsAccuratelyAsTheBound) {
    const Settings settings;
    const auto plan = campaign_plan(settings, positions(14), {9, 7}, 100);
    const PlanReport report = report_plan(settings, plan, kPlanPeriod_s);
    const auto bound =
        predicted_sigma(settings, plan, std::array<double, kParameters>{}, kPlanPeriod_s);
    EXPECT_TRUE(plan_warnings(report).empty());
    for (std::size_t i = 0; i < kParameters; ++i) {
        EXPECT_TRUE(report.observable[i]) << parameter_names()[i];
        EXPECT_NEAR(report.sigma[i] / bound[i], 1, 1e-3) << parameter_names()[i];
    }
}

TEST(PlanReport, OneLevelIsReportedByNameWithTheCombinationBeforeAndAfterTheRun) {
    // GIVEN one level: kappa = 19 with 9 g at the table
    Settings settings;
    settings.transmission = 2.0 / 3.0;
    const PlanReport report =
        report_plan(settings, campaign_plan(settings, positions(14), {9, 9}, 20), kPlanPeriod_s);
    for (std::size_t i = 0; i < kParameters; ++i) {
        const std::size_t place = i % 10;
        EXPECT_EQ(report.observable[i], place != 0 && (place < 4 || place > 6));
    }
    // THEN the plan is stated by the names and sums that the result of such a run has
    const Result result = identified(settings, {6, 6});
    EXPECT_EQ(report.observable, result.observable);
    ASSERT_EQ(report.combinations.size(), result.combinations.size());
    ASSERT_FALSE(report.combinations.empty());
    for (std::size_t k = 0; k < report.combinations.size(); ++k) {
        const auto& before = report.combinations[k].weights;
        const auto& after = result.combinations[k].weights;
        ASSERT_EQ(before.size(), after.size());
        for (std::size_t w = 0; w < before.size(); ++w) {
            EXPECT_EQ(before[w].first, after[w].first);
            EXPECT_NEAR(before[w].second, after[w].second, 1e-3 * std::abs(after[w].second));
        }
    }
    const std::vector<std::string> lines = plan_warnings(report);
    EXPECT_NE(lines.at(0).find("D_Fx"), std::string::npos);
    EXPECT_NE(lines.at(1).find("determined is D_Fx + 19 D_OOx"), std::string::npos) << lines.at(1);
}

TEST(PlanReport, WhatTheTwoStepRouteCannotDoIsReportedBeforeAndAfterTheRun) {
    Settings settings;
    settings.method = Method::two_step;
    settings.transmission = 2.0 / 3.0;
    EXPECT_TRUE(
        plan_warnings(report_plan(settings, campaign_plan(settings, positions(14), {9, 7}, 20),
                                  kPlanPeriod_s))
            .empty());
    // GIVEN two equal levels, three levels, and one
    struct Case {
        std::vector<double> table_g;
        std::string found;
    };
    for (const Case& c : {Case{{9, 9}, "found kappa 19"}, Case{{9, 7, 5}, "found more than two"},
                          Case{{9}, "found 1 with good dwells"}}) {
        SCOPED_TRACE(c.found);
        const PlanReport report = report_plan(
            settings, campaign_plan(settings, positions(14), c.table_g, 20), kPlanPeriod_s);
        const std::vector<std::string> lines = plan_warnings(report);
        // THEN all 30 are named before the run, with the reason
        EXPECT_EQ(std::count(report.observable.begin(), report.observable.end(), true), 0);
        ASSERT_EQ(lines.size(), 2U);
        EXPECT_NE(lines[0].find("D_OSz"), std::string::npos);
        EXPECT_NE(lines[1].find(c.found), std::string::npos) << lines[1];
    }
    // AND after it
    const Result result = identified(settings, {6, 6});
    EXPECT_EQ(std::count(result.observable.begin(), result.observable.end(), true), 0);
    EXPECT_TRUE(reported(result, "two runs of different vibration level, found kappa "));
}

TEST(PlanReport, TooFewPositionsOrAnUnsuitableVerticalAreReported) {
    Settings settings;
    const auto undetermined = [](const PlanReport& report) {
        return std::count(report.observable.begin(), report.observable.end(), false);
    };
    const PlanReport few =
        report_plan(settings, campaign_plan(settings, positions(3), {9, 0}, 100), kPlanPeriod_s);
    EXPECT_GT(undetermined(few), 0);
    EXPECT_FALSE(plan_warnings(few).empty());
    // Table 1 with x up turns about the vertical or in one plane only.
    settings.up = {0, 1};
    const PlanReport lying =
        report_plan(settings, campaign_plan(settings, positions(14), {9, 0}, 100), kPlanPeriod_s);
    EXPECT_GT(undetermined(lying), 0);
    EXPECT_FALSE(lying.combinations.empty() && plan_warnings(lying).size() < 2);
}

}  // namespace
}  // namespace vibrig::estimator::testing
