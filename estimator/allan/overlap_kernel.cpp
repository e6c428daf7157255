#include "estimator/allan/overlap_kernel.hpp"

#include <cstring>

namespace vibrig::estimator::allan {

namespace {

// 8 KiB of phase: with factors in growing octaves the first two operands of a block stay in the
// first cache and only the third streams in. Shorter blocks would jump between as many streams as
// there are factors, at distances of powers of two that all fall into the same few lines of every
// cache.
constexpr std::size_t kBlock = 1024;
constexpr std::size_t kSums = 4;  // side by side, so that no addition waits for the one before

// Plain arrays only: each copy below is compiled for its own instruction set, and an inline
// function of a library would be shared between them by the linker.
using Two = double __attribute__((vector_size(16)));
using Four = double __attribute__((vector_size(32)));
using Eight = double __attribute__((vector_size(64)));

template <typename Lanes>
[[gnu::always_inline]] inline double block(const double* x, std::size_t m, std::size_t length) {
    constexpr std::size_t kLanes = sizeof(Lanes) / sizeof(double);
    Lanes sums[kSums] = {};
    std::size_t i = 0;
    for (; i + kSums * kLanes <= length; i += kSums * kLanes) {
#pragma GCC unroll 4
        for (std::size_t k = 0; k < kSums; ++k) {
            Lanes a, b, c;
            std::memcpy(&a, x + i + k * kLanes, sizeof a);
            std::memcpy(&b, x + i + k * kLanes + m, sizeof b);
            std::memcpy(&c, x + i + k * kLanes + 2 * m, sizeof c);
            a = (c - b) - (b - a);
            sums[k] += a * a;
        }
    }
    for (std::size_t k = 1; k < kSums; ++k) sums[0] += sums[k];
    double sum = 0;
    for (std::size_t lane = 0; lane < kLanes; ++lane) sum += sums[0][lane];
    for (; i < length; ++i) {
        const double difference = (x[i + 2 * m] - x[i + m]) - (x[i + m] - x[i]);
        sum += difference * difference;
    }
    return sum;
}

template <typename Lanes>
[[gnu::always_inline]] inline void sweep(const double* x, std::size_t points,
                                         const std::size_t* factors, std::size_t count,
                                         double* sum) {
    for (std::size_t start = 0; start < points; start += kBlock) {
        for (std::size_t k = 0; k < count; ++k) {
            const std::size_t m = factors[k];
            if (start + 2 * m >= points) {
                continue;
            }
            const std::size_t left = points - 2 * m - start;
            sum[k] += block<Lanes>(x + start, m, left < kBlock ? left : kBlock);
        }
    }
}

using Sweep = void(const double*, std::size_t, const std::size_t*, std::size_t, double*);

void sweep_baseline(const double* x, std::size_t points, const std::size_t* factors,
                    std::size_t count, double* sum) {
    sweep<Two>(x, points, factors, count, sum);
}

#if defined(__x86_64__)
[[gnu::target("avx2,fma")]] void sweep_avx2(const double* x, std::size_t points,
                                            const std::size_t* factors, std::size_t count,
                                            double* sum) {
    sweep<Four>(x, points, factors, count, sum);
}

[[gnu::target("avx512f")]] void sweep_avx512(const double* x, std::size_t points,
                                             const std::size_t* factors, std::size_t count,
                                             double* sum) {
    sweep<Eight>(x, points, factors, count, sum);
}

Sweep* choose() {
    if (__builtin_cpu_supports("avx512f")) {
        return sweep_avx512;
    }
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") ? sweep_avx2
                                                                           : sweep_baseline;
}
#else
Sweep* choose() { return sweep_baseline; }
#endif

}  // namespace

void add_overlapping_squares(const double* x, std::size_t points, const std::size_t* factors,
                             std::size_t count, double* sum) noexcept {
    static Sweep* const chosen = choose();
    chosen(x, points, factors, count, sum);
}

}  // namespace vibrig::estimator::allan
