#pragma once

#include <Eigen/Core>
#include <optional>

#include "estimator/filter/linear_algebra.hpp"

namespace vibrig::estimator::uncertainty {

/// Covariance of n rates in order of time, A + U M U': A holds noise of each rate, a diagonal, and
/// a random walk that is zero at the first, q min(tau_i, tau_j); U a few columns more. No n x n
/// matrix is ever formed: A is whitened as by a Kalman filter of one state, U by Woodbury's
/// identity (docs/theory/uncertainty.md).
class RatesCovariance {
  public:
    /// `elapsed`: times since the first rate, growing; `walk`: q per unit of time.
    RatesCovariance(const Eigen::VectorXd& noise, const Eigen::VectorXd& elapsed, double walk);
    /// Once: U and the inverse of M, which may be indefinite as long as the sum is positive.
    void add(const Eigen::MatrixXd& columns, const Eigen::MatrixXd& inverse_core);

    /// x of whatever columns are added: for many covariances that differ only in those.
    struct Whitened {
        Eigen::MatrixXd x;       ///< n x m
        Eigen::MatrixXd square;  ///< x' A^-1 x
    };
    [[nodiscard]] Whitened whiten(const Eigen::MatrixXd& x) const;

    /// Cov^-1 x, n x m.
    [[nodiscard]] Eigen::MatrixXd solve(const Eigen::MatrixXd& x) const;
    /// x' Cov^-1 x for columns x.
    [[nodiscard]] Eigen::MatrixXd square(const Eigen::MatrixXd& x) const;
    /// The same; `of`: by a covariance of the same noise and walk.
    [[nodiscard]] Eigen::MatrixXd square(const Whitened& of) const;
    [[nodiscard]] double log_determinant() const { return log_determinant_; }

  private:
    [[nodiscard]] Eigen::MatrixXd whitened(const Eigen::MatrixXd& x) const;
    [[nodiscard]] Eigen::MatrixXd whitened_back(Eigen::MatrixXd x) const;

    Eigen::VectorXd gain_, deviation_;  ///< of the filter and its innovations
    Eigen::MatrixXd columns_;           ///< U, whitened; none: no columns
    std::optional<linear_algebra::LowerUpper> core_;
    double log_determinant_ = 0;
};

/// Covariance of rates whose drift is a random walk about its mean over them, and moves along
/// `columns`, each of unit prior variance: diag(noise) + walk P min(tau_i, tau_j) P + U U', P what
/// takes the mean out.
[[nodiscard]] RatesCovariance drifting(const Eigen::VectorXd& noise, const Eigen::VectorXd& elapsed,
                                       double walk, const Eigen::MatrixXd& columns);
/// The same; `still`: of that noise and walk, without any columns.
[[nodiscard]] RatesCovariance drifting(RatesCovariance still, const Eigen::VectorXd& elapsed,
                                       double walk, const Eigen::MatrixXd& columns);
/// Means over j of min(tau_i, tau_j).
[[nodiscard]] Eigen::VectorXd walk_means(const Eigen::VectorXd& elapsed);

}  // namespace vibrig::estimator::uncertainty
