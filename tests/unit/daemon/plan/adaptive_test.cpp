#include "daemon/plan/adaptive.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <random>

#include "daemon/plan/forecast.hpp"
#include "estimator/identification/identification.hpp"
#include "tests/unit/daemon/plan/simulated_rig.hpp"
#include "tests/unit/estimator/uncertainty/theory_rows.hpp"

namespace vibrig::plan {
namespace {

using estimator::Identification;
using estimator::kParameters;

/// Root mean square of sigma over nominal, all 30.
double accuracy(const std::array<double, kParameters>& sigma, const SimulatedRig& rig) {
    double sum = 0;
    for (std::size_t i = 0; i < kParameters; ++i) sum += std::pow(sigma[i] / rig.truth(i), 2);
    return std::sqrt(sum / kParameters);
}

double error_over_nominal(const estimator::Result& result, const SimulatedRig& rig) {
    double sum = 0;
    for (std::size_t i = 0; i < kParameters; ++i)
        sum += std::pow((result.value[i] - rig.truth(i)) / rig.truth(i), 2);
    return std::sqrt(sum / kParameters);
}

TEST(AdaptivePlan, SaysWhetherTargetsOrTimeEndIt) {
    const estimator::Settings settings;
    AdaptiveSettings adaptive;
    adaptive.period_s = kPeriod_s;
    adaptive.table_g = {9, 0};
    adaptive.target = {0.006, 0.005, 0.0005};
    adaptive.time_limit_s = 3000;
    const AdaptivePlan plan(settings, adaptive);
    const auto first = plan.outlook();
    EXPECT_EQ(first.verdict, AdaptivePlan::Verdict::go_on);
    EXPECT_GE(first.left, 10U) << "ten coefficients of a gyro";
    // Nearly out of time, nothing known: the limit ends it, and says what is missed
    std::vector<double> covariance(kParameters * kParameters, 0.0);
    for (std::size_t i = 0; i < kParameters; ++i) covariance[i * kParameters + i] = 1;
    const auto late = plan.next(covariance, {}, 2950);
    EXPECT_EQ(late.verdict, AdaptivePlan::Verdict::time_limit);
    EXPECT_NE(late.words.find("targets missed: bias, linear, quadratic"), std::string::npos)
        << late.words;
    // Everything known: the targets end it
    for (std::size_t i = 0; i < kParameters; ++i) covariance[i * kParameters + i] = 1e-8;
    EXPECT_EQ(plan.next(covariance, {}, 10).verdict, AdaptivePlan::Verdict::targets_met);
    // One level can never do
    adaptive.table_g = {9};
    EXPECT_THROW(AdaptivePlan(settings, adaptive), std::runtime_error);
    adaptive.table_g = {9, 0};
    adaptive.target = {};
    EXPECT_THROW(AdaptivePlan(settings, adaptive), std::runtime_error);
}

TEST(AdaptivePlan, MeetsItsTargetsByWhatTheDwellsScatterAndNotByNoiseAlone) {
    const std::uint64_t seed = 5;
    SCOPED_TRACE("seed " + std::to_string(seed));
    const estimator::Settings settings;
    std::vector<double> covariance(kParameters * kParameters, 0.0);
    for (std::size_t i = 0; i < kParameters; ++i) covariance[i * kParameters + i] = 4;
    covariance[1] = covariance[kParameters] = 1;
    // GIVEN dwells with their noise, and dwells that scatter by four times that
    const auto rows_of = [&](double scatter) {
        std::mt19937_64 random(seed);
        auto rows = estimator::testing::theory_rows(settings, estimator::testing::balanced(6, 5));
        estimator::testing::add_noise(rows, random);
        std::normal_distribution<double> normal;
        for (auto& row : rows) {
            for (double& rate : row.rate) rate += scatter * normal(random);
        }
        return rows;
    };
    const double noise = std::sqrt(estimator::testing::kRateVariance);
    const auto quiet = widened(covariance, settings, estimator::testing::result_of(rows_of(0)));
    const auto scattered =
        widened(covariance, settings, estimator::testing::result_of(rows_of(4 * noise)));
    for (std::size_t i = 0; i < kParameters; ++i) {
        const std::size_t k = i * kParameters + i;
        EXPECT_GE(quiet[k], covariance[k]);
        EXPECT_LE(std::sqrt(quiet[k] / covariance[k]), 1.3);
        EXPECT_NEAR(std::sqrt(scattered[k] / covariance[k]), std::sqrt(17.0), 1.5);
    }
    EXPECT_NEAR(scattered[1] / covariance[1],
                std::sqrt(scattered[0] * scattered[kParameters + 1]) / 4, 1e-9);
    // AND of a few dwells nothing of the kind is known
    auto few = rows_of(4 * noise);
    few.resize(kFewestDwells - 1);
    EXPECT_EQ(widened(covariance, settings, estimator::testing::result_of(few)), covariance);
}

TEST(AdaptivePlan, GoesOnToFourteenDwellsAlsoWhereEveryTargetIsMet) {
    const estimator::Settings settings;
    AdaptiveSettings adaptive;
    adaptive.period_s = kPeriod_s;
    adaptive.table_g = {9, 0};
    adaptive.target = {10, 10, 1};
    const AdaptivePlan plan(settings, adaptive);
    std::vector<double> covariance(kParameters * kParameters, 0.0);
    for (std::size_t i = 0; i < kParameters; ++i) covariance[i * kParameters + i] = 1e-4;
    for (const std::size_t dwells : {std::size_t{0}, std::size_t{11}, kFewestDwells - 1}) {
        const auto next = plan.next(covariance, {}, 0, dwells);
        EXPECT_EQ(next.verdict, AdaptivePlan::Verdict::go_on) << dwells;
        EXPECT_EQ(next.left, kFewestDwells - dwells);
        EXPECT_NE(next.words.find("fewer than 14 dwells"), std::string::npos) << next.words;
    }
    EXPECT_EQ(plan.next(covariance, {}, 0, kFewestDwells).verdict,
              AdaptivePlan::Verdict::targets_met);
}

TEST(AdaptivePlan, EndsBeforeItsTimeLimitWithLevellingAndWhatComesAfterTheLastDwell) {
    // GIVEN dwells that are levelled before, and 400 s of zeroing after the last
    const estimator::Settings settings;
    AdaptiveSettings adaptive;
    adaptive.period_s = kPeriod_s;
    adaptive.table_g = {9, 0};
    adaptive.target = {0.006, 0.005, 0.0005};
    adaptive.time_limit_s = 3000;
    const std::array<double, 3> here{};
    const auto plain = AdaptivePlan(settings, adaptive).outlook();
    adaptive.levelling_s = 130;
    adaptive.closing_s = 400;
    const AdaptivePlan plan(settings, adaptive);
    std::vector<double> covariance(kParameters * kParameters, 0.0);
    for (std::size_t i = 0; i < kParameters; ++i) covariance[i * kParameters + i] = 100;
    const auto run = plan.next(covariance, here, 0).run;
    const double dwell_s = planning::slew_s(here, run.position_deg, adaptive.timing) +
                           adaptive.timing.look_s + adaptive.timing.settle_s +
                           adaptive.timing.dwell_s +
                           (run.table_g > 0 ? 2 * adaptive.timing.ramp_s : 0);
    // THEN the next dwell is begun only if it and the zeroing will be over in time
    const auto verdict = [&](double elapsed_s) {
        return plan.next(covariance, here, elapsed_s).verdict;
    };
    EXPECT_EQ(verdict(3000 - 400 - 130 - dwell_s - 0.1), AdaptivePlan::Verdict::go_on);
    EXPECT_EQ(verdict(3000 - 400 - 130 - dwell_s + 0.1), AdaptivePlan::Verdict::time_limit);
    // AND the outlook counts the levelling
    EXPECT_GE(plan.outlook().left_s, plain.left_s + 129 * static_cast<double>(plain.left));
}

TEST(AdaptivePlanSeeds, ReachesTheAccuracyOfTheFourteenPositionsInHalfTheShakerTime) {
    constexpr std::uint64_t kSeeds = 20;
    const estimator::Settings settings;
    // GIVEN targets at what the 14 positions at 9 and 7 g are expected to reach: the largest bias
    // and linear, the root mean square of the quadratic standard errors
    const Forecast fourteen = forecast(settings, fourteen_positions(), kDwell, kPeriod_s);
    AdaptiveSettings adaptive;
    adaptive.period_s = kPeriod_s;
    adaptive.table_g = {9, 0};
    double squares = 0;
    for (std::size_t i = 0; i < kParameters; ++i) {
        const std::size_t term = i % 10;
        if (term == 0) adaptive.target[0] = std::max(adaptive.target[0], fourteen.sigma[i]);
        if (term > 0 && term < 4)
            adaptive.target[1] = std::max(adaptive.target[1], fourteen.sigma[i]);
        if (term >= 4) squares += fourteen.sigma[i] * fourteen.sigma[i];
    }
    adaptive.target[2] = std::sqrt(squares / 18);
    const AdaptivePlan plan(settings, adaptive);
    double shaker = 0, shaker_fourteen = 0, rig_s = 0, rig_s_fourteen = 0;
    double errors = 0, errors_fourteen = 0;
    for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        // WHEN both are run on the simulated rig
        SimulatedRig listed(seed);
        Identification by_list(settings);
        for (const PlannedRun& run : fourteen_positions()) listed.dwell(by_list, run);
        SimulatedRig chosen(seed + kSeeds);
        Identification by_choice(settings);
        for (;;) {
            const auto next = plan.next(by_choice.covariance(), chosen.here(), chosen.rig_s());
            if (next.verdict != AdaptivePlan::Verdict::go_on) break;
            ASSERT_LT(chosen.dwells(), 60) << next.words;
            chosen.dwell(by_choice, next.run);
        }
        // THEN the accuracy is no worse, in at most half of the time on the shaker
        const auto a = by_choice.result(), b = by_list.result();
        EXPECT_LE(accuracy(a.sigma, chosen), accuracy(b.sigma, listed));
        EXPECT_LE(chosen.shaker_s(), 0.5 * listed.shaker_s());
        errors += std::pow(error_over_nominal(a, chosen), 2) / kSeeds;
        errors_fourteen += std::pow(error_over_nominal(b, listed), 2) / kSeeds;
        shaker += chosen.shaker_s();
        shaker_fourteen += listed.shaker_s();
        rig_s += chosen.rig_s();
        rig_s_fourteen += listed.rig_s();
        // AND no error is beyond its sigma: 600 of them, 5 sigma
        for (std::size_t i = 0; i < kParameters; ++i)
            EXPECT_LT(std::abs(a.value[i] - chosen.truth(i)), 5 * a.sigma[i]);
    }
    std::printf(
        "shaker time over that of the 14 positions: %.3f, whole time %.3f; rms error %.4f, "
        "14 positions %.4f of nominal\n",
        shaker / shaker_fourteen, rig_s / rig_s_fourteen, std::sqrt(errors),
        std::sqrt(errors_fourteen));
    // The quadratic terms carry nearly all of it, 18 a seed: 4 sigma of the ratio of two rms of 360
    // errors is 4 sqrt(1 / 360).
    EXPECT_LT(std::sqrt(errors), 1.21 * std::sqrt(errors_fourteen));
}

}  // namespace
}  // namespace vibrig::plan
