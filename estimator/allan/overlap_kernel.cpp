#include "estimator/allan/overlap_kernel.hpp"

#include <cstring>

namespace vibrig::estimator::allan {

namespace {

constexpr std::size_t kBlock = 64;
constexpr std::size_t kLanes = 8;

using Lanes = double __attribute__((vector_size(kLanes * sizeof(double))));

// Plain arrays only: each copy below is compiled for its own instruction set, and an inline
// function of a library would be shared between them by the linker.
[[gnu::always_inline]] inline double block(const double* x, std::size_t m, std::size_t length) {
    double sum = 0;
    std::size_t i = 0;
    if (length == kBlock) {
        Lanes even{};
        Lanes odd{};
        for (; i < kBlock; i += 2 * kLanes) {
            Lanes a, b, c, d, e, f;
            std::memcpy(&a, x + i, sizeof a);
            std::memcpy(&b, x + i + m, sizeof b);
            std::memcpy(&c, x + i + 2 * m, sizeof c);
            std::memcpy(&d, x + i + kLanes, sizeof d);
            std::memcpy(&e, x + i + kLanes + m, sizeof e);
            std::memcpy(&f, x + i + kLanes + 2 * m, sizeof f);
            a = (c - b) - (b - a);
            d = (f - e) - (e - d);
            even += a * a;
            odd += d * d;
        }
        even += odd;
        for (std::size_t lane = 0; lane < kLanes; ++lane) {
            sum += even[lane];
        }
    }
    for (; i < length; ++i) {
        const double difference = (x[i + 2 * m] - x[i + m]) - (x[i + m] - x[i]);
        sum += difference * difference;
    }
    return sum;
}

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
            sum[k] += block(x + start, m, left < kBlock ? left : kBlock);
        }
    }
}

using Sweep = void(const double*, std::size_t, const std::size_t*, std::size_t, double*);

void sweep_baseline(const double* x, std::size_t points, const std::size_t* factors,
                    std::size_t count, double* sum) {
    sweep(x, points, factors, count, sum);
}

#if defined(__x86_64__)
[[gnu::target("avx2,fma")]] void sweep_avx2(const double* x, std::size_t points,
                                            const std::size_t* factors, std::size_t count,
                                            double* sum) {
    sweep(x, points, factors, count, sum);
}

[[gnu::target("avx512f")]] void sweep_avx512(const double* x, std::size_t points,
                                             const std::size_t* factors, std::size_t count,
                                             double* sum) {
    sweep(x, points, factors, count, sum);
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
