#pragma once

#include <cstddef>

namespace vibrig::estimator {

/// Sums of products of whitened columns, and what leads to them: most of a reading's arithmetic in
/// BatchSolver. Plain arrays, so that it can be compiled for wider registers: these change how many
/// columns are done at once, not in which order anything is added, so that the result is the same
/// to the last bit with all of them. The order is that of Eigen 3.4's products on x86-64.
struct NormalSums {
    static constexpr std::size_t kColumns = 36;  ///< padded with zeros
    static constexpr std::size_t kRows = 24;     ///< of a block: 8 readings of 3 angles

    /// One angle after the other, its columns side by side.
    using Angles = double[3][kColumns];

    /// Lower triangle of the inverse of a Cholesky factor's diagonal and the factor below it, and
    /// what is left of the columns after a reading.
    struct Whitening {
        double inverse[3];
        double below[3];  ///< l10, l20, l21
        double left[3][3];
    };

    /// Columns += scale times that column of `m`, whose three come again and again.
    void (*integrate)(Angles& columns, const double (&scale)[kColumns], const double (&m)[3][3]);
    /// `white` becomes L^-1 of the columns, the columns become what is left of them.
    void (*whiten)(Angles& columns, const Whitening& by, double (*white)[kColumns]);
    /// Adds to sums[j][i], i >= j, the products of columns i and j of a block; above the diagonal
    /// is nothing of use.
    void (*add_block)(const double (&block)[kRows][kColumns], double (&sums)[kColumns][kColumns]);
};

/// The fastest here.
[[nodiscard]] const NormalSums& normal_sums() noexcept;

/// Every one that runs on this processor; for tests.
[[nodiscard]] const NormalSums* normal_sums_of(bool wide) noexcept;

}  // namespace vibrig::estimator
