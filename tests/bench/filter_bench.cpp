#include <benchmark/benchmark.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <string>

#include "estimator/filter/drift_filter.hpp"
#include "estimator/filter/drift_model.hpp"
#include "estimator/filter/instruction_set.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/second_moment.hpp"
#include "estimator/filter/ud_filter.hpp"
#include "estimator/identification/identification.hpp"
#include "tests/bench/dense_filter.hpp"
#include "tests/bench/multiply_adds.hpp"

// The filter's step, predict and three angle updates, against the dense reference in one run on one
// machine: absolute times do not carry from one machine to another. tests/bench/report compares the
// ratios with the goals.

namespace vibrig::bench {
namespace {

constexpr double kPrior = 10;
constexpr double kVariance = 25;
constexpr double kNoGate = 1e300;

/// Regressors of a platform that turns slowly, a quarter turn in 1024 steps.
std::array<estimator::UdTransition, 1024> transitions() {
    std::array<estimator::UdTransition, 1024> all{};
    for (std::size_t n = 0; n < all.size(); ++n) {
        estimator::UdTransition& t = all[n];
        const double a = 1.5e-3 * static_cast<double>(n);
        const std::array<double, 3> u{std::sin(a) * 0.8, std::cos(a) * 0.8, 0.6};
        for (std::size_t j = 0; j < 3; ++j) {
            const double i = u[j], o = u[(j + 1) % 3], s = u[(j + 2) % 3], k = 19;
            const std::array<double, 10> h{1,         i,         s,         o,         k * i * i,
                                           k * s * s, k * o * o, k * i * s, k * i * o, k * s * o};
            for (std::size_t g = 0; g < 10; ++g) t.h[3 * g + j] = h[g];
            t.f[j][j] = 1;
            t.g[j][j] = 0.025;
            t.noise_map[j][j] = -1;
        }
        t.noise = 9e-5;
    }
    return all;
}

const std::array<estimator::UdTransition, 1024>& steps() {
    static const auto all = transitions();
    return all;
}

/// Readings that the filter can follow.
std::array<double, 3> measured(const std::array<double, 3>& angles, std::uint64_t n) {
    const double noise = static_cast<double>(n % 7) - 3;
    return {angles[0] + noise, angles[1] - noise, angles[2] + 0.5 * noise};
}

void dense(benchmark::State& state) {
    DenseFilter filter(kPrior);
    std::uint64_t n = 0;
    for (auto _ : state) {
        filter.predict(steps()[n % 1024]);
        const double* x = filter.state();
        filter.update(measured({x[0], x[1], x[2]}, n).data(), kVariance);
        ++n;
    }
}
BENCHMARK(dense)->Name("dense_eigen_native");

void ud(benchmark::State& state, const std::string& instruction_set) {
    if (!estimator::force_instruction_set(instruction_set)) {
        state.SkipWithError("not on this processor");
        return;
    }
    std::array<double, 30> sigma{};
    sigma.fill(kPrior);
    estimator::UdFilter filter(sigma);
    filter.start_angles({0, 0, 0}, kVariance);
    std::uint64_t n = 0;
    for (auto _ : state) {
        filter.predict(steps()[n % 1024]);
        benchmark::DoNotOptimize(filter.update(measured(filter.angles(), n), kVariance, kNoGate));
        ++n;
    }
}

void whole_step(benchmark::State& state, const std::string& instruction_set) {
    if (!estimator::force_instruction_set(instruction_set)) {
        state.SkipWithError("not on this processor");
        return;
    }
    const estimator::Settings settings;
    estimator::DriftFilter filter(settings, estimator::prior_sigma(settings));
    filter.begin_dwell();
    std::uint64_t n = 0;
    for (auto _ : state) {
        const double noise = 1e-5 * (static_cast<double>(n % 7) - 3);
        ++n;
        benchmark::DoNotOptimize(
            filter.step(0.025 * static_cast<double>(n), {noise, -noise, noise}, {.kappa = 19}));
    }
}

/// The two parts of the filter's limit: its multiply-adds at the machine's peak, and the model.
void peak(benchmark::State& state) {
    double x = 0.5;
    for (auto _ : state) benchmark::DoNotOptimize(multiply_adds_at_peak(x));
}
BENCHMARK(peak)->Name("multiply_adds_at_peak");

void model(benchmark::State& state) {
    const estimator::Settings settings;
    const estimator::Kinematics kinematics(settings);
    const estimator::DriftModel drift(settings);
    const estimator::ParameterArray constants{};
    Eigen::Vector3d angles(0.1, 0.2, 0.3);
    for (auto _ : state) {
        const estimator::Pose pose = kinematics.pose(angles);
        const Eigen::Matrix3d moment = estimator::second_moment(pose, {.kappa = 19});
        const estimator::Regressors h = drift.regressors(pose.up, moment);
        const Eigen::Vector3d rate = drift.platform_rate(pose, h, constants.data());
        const Eigen::Matrix3d jacobian = drift.jacobian(pose, moment, constants.data(), rate);
        benchmark::DoNotOptimize(h);
        benchmark::DoNotOptimize(jacobian);
        angles += 1e-6 * (pose.m * rate);
    }
}
BENCHMARK(model)->Name("model_of_step");

/// Everything a sample of a campaign costs: level, filter, batch cross-check.
void identify(benchmark::State& state) {
    estimator::Identification identification{estimator::Settings{}};
    constexpr std::uint64_t kDwell = 4000;
    std::array<double, 8> level{};
    for (std::size_t i = 0; i < level.size(); ++i) {
        level[i] = 1 + 6 * std::sin(0.75 * 3.14159265358979 * static_cast<double>(i));
    }
    std::uint64_t n = 0;
    for (auto _ : state) {
        if (n % kDwell == 0) identification.begin_dwell({});
        const double noise = 1e-5 * (static_cast<double>(n % 7) - 3);
        estimator::Measurement m;
        m.time_s = 0.025 * static_cast<double>(n++ % kDwell);
        m.angle_rad = {noise, -noise, noise};
        m.force_g = {0, level[n % 8], 0};
        benchmark::DoNotOptimize(identification.add(m));
    }
}
BENCHMARK(identify)->Name("identify_sample");

}  // namespace
}  // namespace vibrig::bench

int main(int argc, char** argv) {
    for (const std::string name : {"sse2", "avx2", "avx512", "auto"}) {
        benchmark::RegisterBenchmark(("ud_" + name).c_str(), vibrig::bench::ud, name);
    }
    benchmark::RegisterBenchmark("step_with_model_auto", vibrig::bench::whole_step, "auto");
    benchmark::Initialize(&argc, argv);
    benchmark::AddCustomContext("instruction_set",
                                std::string(vibrig::estimator::instruction_set()));
    benchmark::RunSpecifiedBenchmarks();
}
