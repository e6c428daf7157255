#include <benchmark/benchmark.h>

#include <random>

#include "estimator/identification/result.hpp"
#include "estimator/spectrum/analysis.hpp"
#include "estimator/uncertainty/assessment.hpp"
#include "tests/unit/estimator/spectrum/survey.hpp"
#include "tests/unit/estimator/uncertainty/theory_rows.hpp"

// What follows each dwell, or a campaign over frequency, outside the real-time threads.

namespace vibrig::bench {
namespace {

namespace rows = estimator::testing;

estimator::Result result_of(std::size_t dwells) {
    const auto order = rows::balanced(6, 14.0 / 3);
    std::vector<rows::PlannedRow> plan;
    while (plan.size() < dwells) plan.push_back(order[plan.size() % order.size()]);
    auto all = rows::theory_rows({}, plan);
    std::mt19937_64 random(1);
    rows::add_noise(all, random);
    return rows::result_of(std::move(all));
}

void verdict(benchmark::State& state, std::size_t dwells) {
    const estimator::Settings settings;
    const estimator::Result result = result_of(dwells);
    for (auto unused : state)
        benchmark::DoNotOptimize(estimator::uncertainty::assess(settings, result));
}

void verdict_28(benchmark::State& state) { verdict(state, 28); }
void verdict_250(benchmark::State& state) { verdict(state, 250); }
void verdict_2000(benchmark::State& state) { verdict(state, 2000); }
BENCHMARK(verdict_28);
BENCHMARK(verdict_250);
BENCHMARK(verdict_2000);

/// A survey of 63 dwells of a rig that resonates: test, mixtures, declared inputs.
void survey_63(benchmark::State& state) {
    namespace spectrum = estimator::spectrum;
    namespace made = spectrum::testing;
    const estimator::Settings settings;
    auto dwells = made::dwells_of(settings, made::Truth::common(0.5, made::kSixty), made::survey());
    std::mt19937_64 random(1);
    made::add_noise(dwells, random);
    const spectrum::SpectralTable table(settings, dwells.list, dwells.kinds);
    for (auto unused : state)
        benchmark::DoNotOptimize(spectrum::analyse(settings, table, spectrum::Form::automatic));
}
BENCHMARK(survey_63);

}  // namespace
}  // namespace vibrig::bench

BENCHMARK_MAIN();
