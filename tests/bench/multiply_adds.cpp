#include "tests/bench/multiply_adds.hpp"

namespace vibrig::bench {
namespace {

#if defined(__AVX512F__)
constexpr int kLanes = 8;
#else
constexpr int kLanes = 4;
#endif
using Lanes = double __attribute__((vector_size(kLanes * sizeof(double))));

}  // namespace

double multiply_adds_at_peak(double x) {
    constexpr int kChains = 12;  // two units, latency of four to five, and some to spare
    constexpr int kRounds = (multiply_adds_of_step() + kChains * kLanes - 1) / (kChains * kLanes);
    Lanes chain[kChains];
    const Lanes factor = Lanes{} + x;
    for (int i = 0; i < kChains; ++i) chain[i] = Lanes{} + static_cast<double>(i);
    for (int round = 0; round < kRounds; ++round) {
#pragma GCC unroll 12
        for (int i = 0; i < kChains; ++i) chain[i] = chain[i] * factor + factor;
    }
    Lanes sum{};
    for (int i = 0; i < kChains; ++i) sum += chain[i];
    double total = 0;
    for (int i = 0; i < kLanes; ++i) total += sum[i];
    return total;
}

}  // namespace vibrig::bench
