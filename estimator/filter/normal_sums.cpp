#include "estimator/filter/normal_sums.hpp"

// Multiplications and additions are not contracted (CMakeLists.txt): with one rounding in place of
// two the result would depend on the processor.

namespace vibrig::estimator {
namespace {

constexpr std::size_t kColumns = NormalSums::kColumns, kRows = NormalSums::kRows;
/// Where the products of whole panels of Eigen's end: the rows behind them are summed in two parts.
constexpr std::size_t kPanels = 32;

typedef double Quad __attribute__((vector_size(32)));
typedef double QuadAnywhere __attribute__((vector_size(32), aligned(8), may_alias));

[[gnu::always_inline]] inline const QuadAnywhere& quad(const double* at) {
    return *reinterpret_cast<const QuadAnywhere*>(at);
}
[[gnu::always_inline]] inline QuadAnywhere& quad(double* at) {
    return *reinterpret_cast<QuadAnywhere*>(at);
}

[[gnu::always_inline]] inline void integrate(NormalSums::Angles& columns,
                                             const double (&scale)[kColumns],
                                             const double (&m)[3][3]) {
    for (std::size_t r = 0; r < 3; ++r) {
        const Quad one{m[r][0], m[r][1], m[r][2], m[r][0]};
        const Quad two{m[r][1], m[r][2], m[r][0], m[r][1]};
        const Quad three{m[r][2], m[r][0], m[r][1], m[r][2]};
        for (std::size_t c = 0; c < kColumns; c += 12) {
            quad(&columns[r][c]) += quad(&scale[c]) * one;
            quad(&columns[r][c + 4]) += quad(&scale[c + 4]) * two;
            quad(&columns[r][c + 8]) += quad(&scale[c + 8]) * three;
        }
    }
}

[[gnu::always_inline]] inline void whiten(NormalSums::Angles& columns,
                                          const NormalSums::Whitening& by,
                                          double (*white)[kColumns]) {
    const auto& [inverse, below, left] = by;
    for (std::size_t c = 0; c < kColumns; c += 4) {
        const Quad d0 = quad(&columns[0][c]), d1 = quad(&columns[1][c]), d2 = quad(&columns[2][c]);
        const Quad w0 = d0 * inverse[0];
        const Quad w1 = (d1 - below[0] * w0) * inverse[1];
        quad(&white[0][c]) = w0;
        quad(&white[1][c]) = w1;
        quad(&white[2][c]) = (d2 - below[1] * w0 - below[2] * w1) * inverse[2];
        quad(&columns[0][c]) = left[0][0] * d0 + left[0][1] * d1 + left[0][2] * d2;
        quad(&columns[1][c]) = left[1][0] * d0 + left[1][1] * d1 + left[1][2] * d2;
        quad(&columns[2][c]) = left[2][0] * d0 + (left[2][1] * d1 + left[2][2] * d2);
    }
}

/// sums[j][i] for four j and kQuads fours of i, each one sum over the rows.
template <std::size_t kQuads>
[[gnu::always_inline]] inline void add_tile(const double (&block)[kRows][kColumns],
                                            double (&sums)[kColumns][kColumns], std::size_t j,
                                            std::size_t i) {
    Quad sum[4][kQuads] = {};
    for (std::size_t k = 0; k < kRows; ++k) {
        for (std::size_t a = 0; a < 4; ++a) {
            for (std::size_t q = 0; q < kQuads; ++q)
                sum[a][q] += block[k][j + a] * quad(&block[k][i + 4 * q]);
        }
    }
    for (std::size_t a = 0; a < 4; ++a) {
        for (std::size_t q = 0; q < kQuads; ++q) quad(&sums[j + a][i + 4 * q]) += sum[a][q];
    }
}

/// The rows behind the panels: even and odd ones of the block apart.
[[gnu::always_inline]] inline void add_last(const double (&block)[kRows][kColumns],
                                            double (&sums)[kColumns][kColumns], std::size_t j) {
    Quad even[4] = {}, odd[4] = {};
    for (std::size_t k = 0; k < kRows; k += 2) {
        for (std::size_t a = 0; a < 4; ++a) {
            even[a] += block[k][j + a] * quad(&block[k][kPanels]);
            odd[a] += block[k + 1][j + a] * quad(&block[k + 1][kPanels]);
        }
    }
    for (std::size_t a = 0; a < 4; ++a) quad(&sums[j + a][kPanels]) += even[a] + odd[a];
}

template <std::size_t kQuads>
[[gnu::always_inline]] inline void add_block(const double (&block)[kRows][kColumns],
                                             double (&sums)[kColumns][kColumns]) {
    for (std::size_t j = 0; j < kPanels; j += 4) {
        std::size_t i = j;
        for (; i + 4 * kQuads <= kPanels; i += 4 * kQuads) add_tile<kQuads>(block, sums, j, i);
        for (; i < kPanels; i += 4) add_tile<1>(block, sums, j, i);
        add_last(block, sums, j);
    }
    add_tile<1>(block, sums, kPanels, kPanels);
}

constexpr NormalSums kBaseline{
    [](NormalSums::Angles& c, const double (&s)[kColumns], const double (&m)[3][3]) {
        integrate(c, s, m);
    },
    [](NormalSums::Angles& c, const NormalSums::Whitening& by, double (*white)[kColumns]) {
        whiten(c, by, white);
    },
    [](const double (&block)[kRows][kColumns], double (&sums)[kColumns][kColumns]) {
        add_block<1>(block, sums);
    }};

#ifdef VIBRIG_X86_KERNELS
[[gnu::target("avx2")]] void wide_integrate(NormalSums::Angles& c, const double (&s)[kColumns],
                                            const double (&m)[3][3]) {
    integrate(c, s, m);
}
[[gnu::target("avx2")]] void wide_whiten(NormalSums::Angles& c, const NormalSums::Whitening& by,
                                         double (*white)[kColumns]) {
    whiten(c, by, white);
}
[[gnu::target("avx2")]] void wide_add_block(const double (&block)[kRows][kColumns],
                                            double (&sums)[kColumns][kColumns]) {
    add_block<2>(block, sums);
}
constexpr NormalSums kWide{wide_integrate, wide_whiten, wide_add_block};
#endif

}  // namespace

const NormalSums* normal_sums_of(bool wide) noexcept {
    if (!wide) return &kBaseline;
#ifdef VIBRIG_X86_KERNELS
    if (__builtin_cpu_supports("avx2")) return &kWide;
#endif
    return nullptr;
}

const NormalSums& normal_sums() noexcept {
    static const NormalSums* const fastest =
        normal_sums_of(true) != nullptr ? normal_sums_of(true) : &kBaseline;
    return *fastest;
}

}  // namespace vibrig::estimator
