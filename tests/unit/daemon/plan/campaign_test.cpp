#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <numbers>
#include <random>

#include "daemon/plan/adaptive.hpp"
#include "daemon/plan/forecast.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/identification/crlb.hpp"
#include "estimator/identification/identification.hpp"
#include "estimator/plan/exact.hpp"
#include "estimator/plan/positions.hpp"
#include "tests/plant/recording.hpp"
#include "tests/unit/estimator/uncertainty/theory_rows.hpp"

namespace vibrig::plan {
namespace {

using estimator::Identification;
using estimator::kParameters;

constexpr double kDwell = 100, kPeriod_s = 0.025;

/// The simulated rig, one dwell at a time, each with noise of its own.
class SimulatedRig {
  public:
    explicit SimulatedRig(std::uint64_t seed) { truth_.seed = 1000 * seed; }

    void dwell(Identification& to, const PlannedRun& run) {
        plant::CampaignPlan plan;
        plan.positions_deg = {run.position_deg};
        plan.table_g = {run.table_g};
        plan.dwell_s = kDwell;
        ++truth_.seed;
        ++dwells_;
        to.begin_dwell({1, dwells_, run.table_g});
        static_cast<void>(plant::simulate(truth_, plan, [&](const plant::PlannedSample& s) {
            estimator::Measurement m;
            m.time_s = s.time_s;
            for (std::size_t k = 0; k < 3; ++k) {
                m.angle_rad[k] = s.readings.encoder_deg[k] * std::numbers::pi / 180;
                m.force_g[k] = s.readings.raw_g[k];
            }
            static_cast<void>(to.add(m));
        }));
        static_cast<void>(to.end_dwell());
        if (run.table_g > 0) shaker_s_ += kDwell + timing_.settle_s + 2 * timing_.ramp_s;
        rig_s_ += kDwell + timing_.settle_s + (run.table_g > 0 ? 2 * timing_.ramp_s : 0) +
                  planning::slew_s(here_, run.position_deg, timing_);
        here_ = run.position_deg;
    }

    [[nodiscard]] double shaker_s() const { return shaker_s_; }
    [[nodiscard]] double rig_s() const { return rig_s_; }
    [[nodiscard]] int dwells() const { return dwells_; }
    [[nodiscard]] const std::array<double, 3>& here() const { return here_; }
    [[nodiscard]] double truth(std::size_t i) const { return truth_.coefficients[i / 10][i % 10]; }

  private:
    plant::Truth truth_;
    planning::Timing timing_;
    std::array<double, 3> here_{};
    double shaker_s_ = 0, rig_s_ = 0;
    int dwells_ = 0;
};

std::vector<PlannedRun> fourteen_positions() {
    std::vector<PlannedRun> runs;
    for (const double table_g : {9.0, 7.0}) {
        for (const auto& position : plant::CampaignPlan::table1())
            runs.push_back({position, table_g * estimator::Settings{}.transmission, table_g, 1});
    }
    return runs;
}

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
