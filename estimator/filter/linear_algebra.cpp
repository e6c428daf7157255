#include "estimator/filter/linear_algebra.hpp"

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace vibrig::estimator::linear_algebra {

namespace {

/// Eigen picks the largest column by its norm: of one that is no number it reads out of bounds.
Eigen::ColPivHouseholderQR<Matrix> pivoted(MatrixIn a) {
    if (!std::isfinite(a.squaredNorm()))
        throw std::domain_error(
            "found a matrix with an element that is not finite, or too large to be squared, "
            "expected finite ones");
    return Eigen::ColPivHouseholderQR<Matrix>(a);
}

}  // namespace

SymmetricEigen symmetric_eigen(MatrixIn a) {
    const Eigen::SelfAdjointEigenSolver<Matrix> solver(a);
    return {solver.eigenvalues(), solver.eigenvectors()};
}

Vector symmetric_eigenvalues(MatrixIn a) {
    return Eigen::SelfAdjointEigenSolver<Matrix>(a, Eigen::EigenvaluesOnly).eigenvalues();
}

RightSingular right_singular(MatrixIn a) {
    // A P = Q R: the triangle has A's singular values, and P turns its right vectors into A's.
    const auto qr = pivoted(a);
    const Matrix r = qr.matrixQR().topRows(a.cols()).triangularView<Eigen::Upper>();
    const Eigen::JacobiSVD<Matrix, Eigen::NoQRPreconditioner> svd(r, Eigen::ComputeFullV);
    return {svd.singularValues(), qr.colsPermutation() * svd.matrixV()};
}

std::optional<Cholesky> Cholesky::of(MatrixIn a) {
    const Eigen::LLT<Matrix> factor(a);
    if (factor.info() != Eigen::Success || !a.allFinite()) return std::nullopt;
    return Cholesky(factor.matrixL());
}

Cholesky Cholesky::or_nan(MatrixIn a) {
    auto factor = of(a);
    return factor ? std::move(*factor)
                  : Cholesky(Matrix::Constant(a.rows(), a.cols(),
                                              std::numeric_limits<double>::quiet_NaN()));
}

double Cholesky::log_det() const { return 2 * lower_.diagonal().array().log().sum(); }

double Cholesky::least_pivot() const { return lower_.diagonal().minCoeff(); }

Matrix Cholesky::whiten(MatrixIn b) const {
    Matrix x = b;
    lower_.triangularView<Eigen::Lower>().solveInPlace(x);
    return x;
}

Matrix Cholesky::solve(MatrixIn b) const {
    Matrix x = whiten(b);
    lower_.triangularView<Eigen::Lower>().transpose().solveInPlace(x);
    return x;
}

Matrix Cholesky::inverse() const { return solve(Matrix::Identity(lower_.rows(), lower_.cols())); }

Matrix positive_inverse(MatrixIn a) { return Cholesky::or_nan(a).inverse(); }

double squared_distance(MatrixIn covariance, const Vector& d) {
    return Cholesky::or_nan(covariance).whiten(d).squaredNorm();
}

Matrix padded_root(MatrixIn a) {
    return Cholesky::or_nan(a + 1e-12 * Matrix(a.diagonal().asDiagonal())).lower();
}

Matrix semidefinite_root(MatrixIn a) {
    const Eigen::LDLT<Matrix> factor(Matrix(a + 1e-12 * Matrix(a.diagonal().asDiagonal())));
    const Vector d = factor.vectorD().cwiseMax(0.0).cwiseSqrt();
    return factor.transpositionsP().transpose() * Matrix(Matrix(factor.matrixL()) * d.asDiagonal());
}

struct PivotedCholesky::Factor {
    Eigen::LDLT<Matrix> of;
};
PivotedCholesky::PivotedCholesky(MatrixIn a)
    : factor_(std::make_unique<Factor>(Factor{Eigen::LDLT<Matrix>(a)})) {}
PivotedCholesky::~PivotedCholesky() = default;
Matrix PivotedCholesky::solve(MatrixIn b) const { return factor_->of.solve(b); }

struct LowerUpper::Factor {
    Eigen::PartialPivLU<Matrix> of;
};
LowerUpper::LowerUpper(MatrixIn a)
    : factor_(std::make_shared<Factor>(Factor{Eigen::PartialPivLU<Matrix>(a)})) {}
Matrix LowerUpper::solve(MatrixIn b) const { return factor_->of.solve(b); }
double LowerUpper::log_det() const {
    return factor_->of.matrixLU().diagonal().array().abs().log().sum();
}

Matrix orthogonal_factor(MatrixIn a) { return pivoted(a).householderQ(); }

Matrix least_squares(MatrixIn a, MatrixIn b) {
    if (!b.allFinite())
        throw std::domain_error("found a right side that is not finite, expected finite elements");
    return pivoted(a).solve(b);
}

Eigen::Index rank(MatrixIn a, double least) { return pivoted(a).setThreshold(least).rank(); }

Matrix product(MatrixIn a, MatrixIn b) { return a * b; }

Matrix gram(MatrixIn a) { return a.transpose() * a; }

CovarianceEigen covariance_eigen(const Covariance& a) noexcept {
    const Eigen::SelfAdjointEigenSolver<Covariance> solver(a);
    return {solver.eigenvalues(), solver.eigenvectors()};
}

Covariance covariance_inverse(const Covariance& a) noexcept {
    const Eigen::LLT<Covariance> factor(a);
    if (factor.info() != Eigen::Success) {
        return Covariance::Constant(std::numeric_limits<double>::quiet_NaN());
    }
    return factor.solve(Covariance::Identity());
}

}  // namespace vibrig::estimator::linear_algebra
