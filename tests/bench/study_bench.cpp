// What a simulated campaign of a study costs: all of it with the instruction set that studies have
// unless told otherwise (baseline) and with the best, and what of it is the simulated rig.
#include <benchmark/benchmark.h>

#include "daemon/study/campaigns.hpp"
#include "estimator/filter/instruction_set.hpp"
#include "tests/plant/recording.hpp"

namespace {

using namespace vibrig;

/// One of a study's, with its instruction set.
void campaign_with(benchmark::State& state, const char* instruction_set) {
    estimator::use_instruction_set(instruction_set);
    const auto study = study::parse_study(
        "[study]\nname = 'a'\nkind = 'campaigns'\n[campaign]\ndwell_s = 100\n", "STUDY.toml");
    const auto sequences = study::check_campaigns(study, "STUDY.toml");
    study::CampaignWorker worker(study, sequences);
    for (auto _ : state) benchmark::DoNotOptimize(worker.run(0));
}
void campaign(benchmark::State& state) {
    campaign_with(state, estimator::instruction_sets().front().data());
}
BENCHMARK(campaign)->Iterations(1)->Unit(benchmark::kMillisecond);

void campaign_auto(benchmark::State& state) { campaign_with(state, "auto"); }
BENCHMARK(campaign_auto)->Iterations(1)->Unit(benchmark::kMillisecond);

void campaign_simulated(benchmark::State& state) {
    const plant::CampaignPlan plan;
    double sum = 0;
    for (auto _ : state) {
        plant::simulate(plant::Truth{}, plan,
                        [&](const plant::PlannedSample& s) { sum += s.readings.raw_g[0]; });
    }
    benchmark::DoNotOptimize(sum);
}
BENCHMARK(campaign_simulated)->Iterations(1)->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
