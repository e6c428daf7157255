#include "daemon/plan/forecast.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "daemon/plan/adaptive.hpp"
#include "estimator/filter/encoder_angles.hpp"
#include "estimator/identification/identification.hpp"
#include "estimator/identification/result.hpp"
#include "estimator/plan/exact.hpp"
#include "estimator/plan/positions.hpp"
#include "tests/unit/daemon/plan/simulated_rig.hpp"

namespace vibrig::plan {
namespace {

using estimator::Identification;
using estimator::kParameters;

TEST(PlannedCampaign, PredictedStandardErrorsAreThoseOfTheFilter) {
    // GIVEN an exact plan of 14 runs at 0 and 6 g, and what is expected of it
    const estimator::Settings settings;
    planning::Problem problem;
    std::vector<PlannedRun> candidates;
    for (const double table_g : {0.0, 9.0}) {
        for (const auto& u : planning::cube_directions()) {
            const double level = table_g * settings.transmission;
            candidates.push_back({*planning::position_for(settings, u, {}), level, table_g, 1});
            problem.points.push_back({planning::vibration_row(u, level)});
        }
    }
    const auto counts = planning::exact_design(problem, 14, {});
    std::vector<PlannedRun> runs;
    for (std::size_t i = 0; i < counts.size(); ++i)
        runs.insert(runs.end(), counts[i], candidates[i]);
    const Forecast expected = forecast(settings, runs, kDwell, kPeriod_s);
    ASSERT_TRUE(expected.identifies_all);

    // WHEN it is run on the simulated rig
    SimulatedRig rig(1);
    Identification identification(settings);
    for (const PlannedRun& run : runs) rig.dwell(identification, run);

    // THEN every standard error agrees within 10 %, and the covariance is the result's
    const auto result = identification.result();
    const auto covariance = identification.covariance();
    for (std::size_t i = 0; i < kParameters; ++i) {
        EXPECT_NEAR(result.sigma[i] / expected.sigma[i], 1.0, 0.1)
            << estimator::parameter_names()[i];
        EXPECT_NEAR(std::sqrt(covariance[i * kParameters + i]), result.sigma[i],
                    1e-9 * result.sigma[i]);
    }
}

TEST(PlannedCampaign, OneLevelIsRefusedWithNamesAndRemedy) {
    const estimator::Settings settings;
    auto runs = fourteen_positions();
    runs.resize(14);
    const Forecast one = forecast(settings, runs, kDwell, kPeriod_s);
    EXPECT_FALSE(one.identifies_all);
    EXPECT_EQ(one.rank, 9U);
    for (const char* words : {"D_Fx", "D_OOz", "cheapest remedy: add (", "at 0 g"})
        EXPECT_NE(one.refusal.find(words), std::string::npos) << words << ": " << one.refusal;
    // AND levels that lie close are warned of
    for (const PlannedRun& run : fourteen_positions()) {
        if (run.table_g == 9) runs.push_back({run.position_deg, 5.9, 5.9 / 0.6667, 1});
    }
    const Forecast close = forecast(settings, runs, kDwell, kPeriod_s);
    EXPECT_TRUE(close.identifies_all);
    EXPECT_NE(close.warning.find("would halve"), std::string::npos) << close.warning;
}

TEST(PlannedCampaign, TheForecastIsTheSameHoweverTheEncodersCount) {
    // GIVEN the 14 positions on a rig whose encoders count the other way, from other zeros
    estimator::Settings rig;
    rig.encoder_sign = {-1, 1, -1};
    rig.encoder_zero_deg = {30, -2, 200};
    auto runs = fourteen_positions();
    const Forecast plain = forecast({}, runs, kDwell, kPeriod_s);
    for (PlannedRun& run : runs) run.position_deg = estimator::encoder_deg(rig, run.position_deg);
    // THEN what its encoders have to show gives the same standard errors, and what they would have
    // to show elsewhere does not
    const Forecast there = forecast(rig, runs, kDwell, kPeriod_s);
    for (std::size_t i = 0; i < kParameters; ++i)
        EXPECT_NEAR(there.sigma[i] / plain.sigma[i], 1, 1e-6) << estimator::parameter_names()[i];
    EXPECT_FALSE(forecast({}, runs, kDwell, kPeriod_s).sigma == plain.sigma);
    // AND an adaptive campaign expects as many dwells
    AdaptiveSettings adaptive;
    adaptive.period_s = kPeriod_s;
    adaptive.table_g = {9, 0};
    adaptive.target = {0.006, 0.005, 0.0005};
    EXPECT_EQ(AdaptivePlan(rig, adaptive).outlook().left,
              AdaptivePlan({}, adaptive).outlook().left);
}

}  // namespace
}  // namespace vibrig::plan
