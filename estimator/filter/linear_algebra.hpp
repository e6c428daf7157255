#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>

#include "estimator/filter/parameters.hpp"

namespace vibrig::estimator {
/// Covariance of all coefficients, filter order, deg/h units.
using Covariance = Eigen::Matrix<double, kParameters, kParameters>;
}  // namespace vibrig::estimator

/// Factorisations of dense matrices of any size, compiled once: Eigen's templates take seconds in
/// every file that instantiates them. They allocate; not for the path of a sample, but for the two
/// of fixed size. What cannot be factorised is reported as said; those with pivoted columns
/// (right_singular, orthogonal_factor, least_squares, rank) throw std::domain_error for elements
/// that are not finite or whose squares are not.
namespace vibrig::estimator::linear_algebra {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;
using MatrixIn = const Eigen::Ref<const Matrix>&;

/// Eigenvalues and eigenvectors of a symmetric matrix, whose lower triangle is read.
struct SymmetricEigen {
    Vector values;   ///< ascending
    Matrix vectors;  ///< one a column
};
[[nodiscard]] SymmetricEigen symmetric_eigen(MatrixIn a);
[[nodiscard]] Vector symmetric_eigenvalues(MatrixIn a);

/// A = U diag(values) V'.
struct RightSingular {
    Vector values;  ///< descending, as many as columns
    Matrix v;       ///< columns x columns
};
/// At least as many rows as columns.
[[nodiscard]] RightSingular right_singular(MatrixIn a);

/// Cholesky's factor A = L L' of a symmetric positive definite matrix.
class Cholesky {
  public:
    /// Empty if `a` is not positive definite.
    [[nodiscard]] static std::optional<Cholesky> of(MatrixIn a);
    /// NaN, and all that follows from it, if `a` is not positive definite.
    [[nodiscard]] static Cholesky or_nan(MatrixIn a);
    [[nodiscard]] double log_det() const;
    /// Smallest element on L's diagonal.
    [[nodiscard]] double least_pivot() const;
    [[nodiscard]] const Matrix& lower() const { return lower_; }
    /// L^-1 b.
    [[nodiscard]] Matrix whiten(MatrixIn b) const;
    [[nodiscard]] Matrix solve(MatrixIn b) const;
    [[nodiscard]] Matrix inverse() const;

  private:
    explicit Cholesky(Matrix lower) : lower_(std::move(lower)) {}
    Matrix lower_;
};

/// Inverse of a symmetric positive definite matrix; NaN if it is none.
[[nodiscard]] Matrix positive_inverse(MatrixIn a);
/// d' covariance^-1 d; likewise.
[[nodiscard]] double squared_distance(MatrixIn covariance, const Vector& d);

/// L with L L' = A, a variance to which a 1e-12th is added: of inputs that depend on each other
/// wholly it is singular. NaN if A is no variance, or one of something certain.
[[nodiscard]] Matrix padded_root(MatrixIn a);
/// The same, no triangle, where some inputs may have no variance at all: their rows are zero.
[[nodiscard]] Matrix semidefinite_root(MatrixIn a);

/// Factors of a symmetric matrix that rounding may have made indefinite: A = P' L D L' P, pivoted.
class PivotedCholesky {
  public:
    explicit PivotedCholesky(MatrixIn a);
    ~PivotedCholesky();
    PivotedCholesky(const PivotedCholesky&) = delete;
    PivotedCholesky& operator=(const PivotedCholesky&) = delete;
    [[nodiscard]] Matrix solve(MatrixIn b) const;

  private:
    struct Factor;
    std::unique_ptr<Factor> factor_;
};

/// Factors of a square matrix that may be indefinite: P A = L U.
class LowerUpper {
  public:
    explicit LowerUpper(MatrixIn a);
    [[nodiscard]] Matrix solve(MatrixIn b) const;
    /// ln |det A|.
    [[nodiscard]] double log_det() const;

  private:
    struct Factor;
    std::shared_ptr<const Factor> factor_;
};

/// Orthogonal matrix Q, rows x rows: its first columns span those of `a`, the others are normal to
/// them.
[[nodiscard]] Matrix orthogonal_factor(MatrixIn a);
/// X that minimises |A X - B|; columns pivoted by size, so that nearly dependent ones do no harm.
[[nodiscard]] Matrix least_squares(MatrixIn a, MatrixIn b);
/// Columns that are independent: pivots above `least` of the largest one.
[[nodiscard]] Eigen::Index rank(MatrixIn a, double least);
[[nodiscard]] Matrix product(MatrixIn a, MatrixIn b);
/// A' A.
[[nodiscard]] Matrix gram(MatrixIn a);

/// Eigenvalues and eigenvectors of the covariance of all 30 coefficients, without allocation: the
/// estimator's thread asks for these.
struct CovarianceEigen {
    Eigen::Matrix<double, kParameters, 1> values;  ///< ascending
    Covariance vectors;
};
[[nodiscard]] CovarianceEigen covariance_eigen(const Covariance& a) noexcept;
/// Inverse of a symmetric positive definite matrix; NaN if it is none.
[[nodiscard]] Covariance covariance_inverse(const Covariance& a) noexcept;

}  // namespace vibrig::estimator::linear_algebra
