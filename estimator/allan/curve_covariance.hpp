#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "estimator/allan/noise_terms.hpp"

namespace vibrig::estimator::allan {

/// Covariance of the overlapping Allan variances of one record at several averaging factors.
///
/// With d_i(m) = theta_{i+2m} - 2 theta_{i+m} + theta_i and M = points - 2m of them,
///     AVAR(m) = sum_i d_i(m)^2 / (2 tau^2 M).
/// Gaussian d with a mean mu(m) = R tau^2 / 3600 that only the ramp gives (Isserlis' theorem):
///     cov(d_i(m)^2, d_k(l)^2) = 2 C(i - k)^2 + 4 mu(m) mu(l) C(i - k),  C = cov(d_i(m), d_k(l)).
/// C is a fourth difference of the angle's generalised covariance, for lags t of tau0:
///     Q^2 [t = 0], -(60 N)^2 tau0 |t| / 2, B^2 tau0^2 t^2 ln|t| / (2 pi), (K / 60)^2 tau0^3 |t|^3
///     / 12.
/// The sums over lags of the products of the terms' C do not depend on the coefficients: they are
/// made once, sampled where C is smooth (within about 1 %).
class CurveCovariance {
    static constexpr std::size_t kNoises = 4;  ///< Q, N, B, K

  public:
    /// The covariance at chosen factors as a function of the coefficients: cheap to take again.
    class At {
      public:
        /// (deg/h)^4, for a record without gaps.
        [[nodiscard]] Eigen::MatrixXd of(const Terms& terms) const;
        /// Derivative by the logarithm of the term's square.
        [[nodiscard]] Eigen::MatrixXd slope(const Terms& terms, std::size_t term) const;

      private:
        friend class CurveCovariance;
        [[nodiscard]] std::array<double, kNoises> scale(const Terms& terms) const;
        double tau0_ = 1;
        /// By pairs of Q, N, B, K, the lower triangle; then with the ramp.
        std::array<Eigen::MatrixXd, kNoises*(kNoises + 1) / 2> pair_;
        std::array<Eigen::MatrixXd, kNoises> ramp_;
    };

    /// `points` phase points at steps of tau0 (s). Factors above half of the record are ignored.
    CurveCovariance(std::span<const std::size_t> factors, std::size_t points, double tau0);

    /// Covariance of AVAR at these averaging factors, (deg/h)^4, for a record without gaps. Throws
    /// std::out_of_range for a factor that the constructor was not given.
    [[nodiscard]] Eigen::MatrixXd of(std::span<const std::size_t> factors,
                                     const Terms& terms) const;
    [[nodiscard]] At at(std::span<const std::size_t> factors) const;

    [[nodiscard]] std::size_t points() const { return points_; }
    [[nodiscard]] double tau0() const { return tau0_; }

  private:
    struct Sums {
        /// Over all pairs of differences, of C_a C_b and of C_a; both over M(m) M(l).
        std::array<std::array<double, kNoises>, kNoises> product{};
        std::array<double, kNoises> single{};
    };
    using Values = std::array<double, kNoises>;

    [[nodiscard]] Sums sums_of(double m, double l) const;
    [[nodiscard]] std::size_t index_of(std::size_t factor) const;

    std::vector<std::size_t> factors_;
    std::size_t points_;
    double tau0_;
    std::vector<Sums> sums_;  ///< lower triangle by rows
};

}  // namespace vibrig::estimator::allan
