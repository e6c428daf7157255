#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstring>
#include <random>
#include <vector>

#include "estimator/allan/dynamic.hpp"
#include "estimator/allan/overlap_kernel.hpp"

// Overlapping Allan variance at octave factors of a million phase points, against the textbook loop
// (one pass for each factor) and the limit (one load of all three operands, nothing else).

namespace vibrig::bench {
namespace {

using namespace estimator::allan;

constexpr std::size_t kPoints = 1000001;

const std::vector<double>& phase() {
    static const std::vector<double> x = [] {
        std::mt19937_64 generator(1);
        std::normal_distribution<double> normal;
        std::vector<double> values(kPoints);
        double sum = 0;
        for (double& value : values) {
            value = sum += normal(generator);
        }
        return values;
    }();
    return x;
}

std::vector<std::size_t> octaves() {
    std::vector<std::size_t> factors;
    for (std::size_t m = 1; 2 * m < kPoints; m *= 2) {
        factors.push_back(m);
    }
    return factors;
}

void oadev_blocks(benchmark::State& state) {
    const std::vector<std::size_t> factors = octaves();
    const std::vector<double>& x = phase();
    for (auto unused : state) {
        std::vector<double> sums(factors.size(), 0.0);
        add_overlapping_squares(x.data(), kPoints, factors.data(), factors.size(), sums.data());
        benchmark::DoNotOptimize(sums.data());
    }
}
BENCHMARK(oadev_blocks);

void oadev_textbook(benchmark::State& state) {
    const std::vector<std::size_t> factors = octaves();
    const std::vector<double>& x = phase();
    for (auto unused : state) {
        for (const std::size_t m : factors) {
            double sum = 0;
            for (std::size_t i = 0; i + 2 * m < kPoints; ++i) {
                const double d = x[i + 2 * m] - 2 * x[i + m] + x[i];
                sum += d * d;
            }
            benchmark::DoNotOptimize(sum);
        }
    }
}
BENCHMARK(oadev_textbook);

using Lanes = double __attribute__((vector_size(4 * sizeof(double))));

/// The limit: one load of each of the three operands of every term, and nothing but their sum.
#if defined(__x86_64__)
[[gnu::target_clones("arch=x86-64-v3", "default")]]
#endif
double
load_three(const double* x, std::size_t points, const std::vector<std::size_t>& factors) {
    constexpr std::size_t kBlock = 1024;
    constexpr std::size_t kLanes = 4;
    Lanes a{}, b{}, c{}, d{}, e{}, f{};
    for (std::size_t start = 0; start < points; start += kBlock) {
        for (const std::size_t m : factors) {
            const std::size_t end = std::min(start + kBlock, points < 2 * m ? 0 : points - 2 * m);
            for (std::size_t i = start; i + 2 * kLanes <= end; i += 2 * kLanes) {
                Lanes v[6];
                std::memcpy(&v[0], x + i, sizeof v[0]);
                std::memcpy(&v[1], x + i + m, sizeof v[1]);
                std::memcpy(&v[2], x + i + 2 * m, sizeof v[2]);
                std::memcpy(&v[3], x + i + kLanes, sizeof v[3]);
                std::memcpy(&v[4], x + i + kLanes + m, sizeof v[4]);
                std::memcpy(&v[5], x + i + kLanes + 2 * m, sizeof v[5]);
                a += v[0], b += v[1], c += v[2], d += v[3], e += v[4], f += v[5];
            }
        }
    }
    a += b + c + d + e + f;
    return a[0] + a[1] + a[2] + a[3];
}

void three_loads(benchmark::State& state) {
    const std::vector<std::size_t> factors = octaves();
    const std::vector<double>& x = phase();
    for (auto unused : state) {
        benchmark::DoNotOptimize(load_three(x.data(), kPoints, factors));
    }
}
BENCHMARK(three_loads);

/// One sample into 30 averaging factors; 6 streams of 1000 samples/s are 6000 of these a second.
void sliding_sample(benchmark::State& state) {
    SlidingVariance sliding(1e-3, 60000, window_factors(60000));
    std::size_t i = 0;
    for (auto unused : state) {
        sliding.add(phase()[i] * 1e-3);
        i = i + 1 < kPoints ? i + 1 : 0;
    }
    state.counters["factors"] = static_cast<double>(sliding.factors().size());
}
BENCHMARK(sliding_sample);

}  // namespace
}  // namespace vibrig::bench

BENCHMARK_MAIN();
