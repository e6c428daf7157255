#include <benchmark/benchmark.h>

#include <random>

#include "estimator/identification/result.hpp"
#include "estimator/uncertainty/assessment.hpp"
#include "tests/unit/estimator/uncertainty/theory_rows.hpp"

// What follows each dwell, outside the real-time threads.

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

}  // namespace
}  // namespace vibrig::bench

BENCHMARK_MAIN();
