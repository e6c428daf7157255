#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "estimator/allan/curve_covariance.hpp"
#include "estimator/allan/noise_terms.hpp"

namespace vibrig::estimator::allan {

/// A variance (not deviation) of the curve with what the weights need.
struct VariancePoint {
    double tau = 0;  ///< s
    std::size_t m = 1;
    double variance = 0;  ///< (deg/h)^2
    double share = 1;     ///< terms present over terms of a record without gaps
};

using TermSet = std::array<bool, kTerms>;

/// Maximum of the likelihood over one set of terms.
struct TermFit {
    TermSet has{};
    Terms square{};       ///< squared coefficients, 0 outside the set
    Terms log_sigma{};    ///< 1 sigma of ln(square)
    double deviance = 0;  ///< -2 ln(likelihood), up to a constant of the curve
    std::size_t parameters = 0;
};

/// Likelihood of a curve of overlapping Allan variances v_i under coefficients that give mu_i and
/// their covariance C (CurveCovariance), about an octave apart.
///
/// Variances of few degrees of freedom nu_i = 2 mu_i^2 / C_ii are skewed; their cube roots are not
/// (Wilson and Hilferty 1931): z_i = (v_i / mu_i)^(1/3) has mean 1 - 2 / (9 nu_i) and covariance
/// S_ij = C_ij / (9 mu_i mu_j), so with r the difference
///     -2 ln L = r' S^-1 r + ln det C - 4/3 sum ln mu_i.
class CurveLikelihood {
  public:
    /// Points of zero variance are left out.
    CurveLikelihood(std::span<const VariancePoint> curve, const CurveCovariance& covariance);

    [[nodiscard]] std::size_t points() const { return points_.size(); }
    [[nodiscard]] const std::vector<VariancePoint>& curve() const { return points_; }
    /// Nothing when a term of the set goes to zero: a smaller set says the same.
    [[nodiscard]] std::optional<TermFit> best(const TermSet& set) const;
    /// With square `value` of term `at` the least deviance over the other terms of `from`, which
    /// may go to zero.
    [[nodiscard]] double profile(const TermFit& from, std::size_t at, double value) const;
    /// Excess of the point over the model, in standard deviations of its cube root.
    [[nodiscard]] double excess(const Terms& squares, std::size_t point) const;
    /// Square of the term that would make all of the curve at its best averaging time.
    [[nodiscard]] double largest_square(std::size_t term) const;

  private:
    struct Evaluated {
        double deviance = 0;
        Eigen::VectorXd mean;
        Eigen::VectorXd spread;  ///< diagonal of S
        double added = 1;        ///< to the diagonal of C, for what the sums over lags miss
        // For a step only:
        Eigen::MatrixXd information;  ///< S^-1
        Eigen::MatrixXd relative;     ///< C over the means, 9 S
        Eigen::VectorXd difference;   ///< r
    };
    [[nodiscard]] Evaluated evaluate(const Terms& squares, bool for_step) const;
    /// Gradient of the deviance by ln(square) of a term, whose share of the means is `part`.
    [[nodiscard]] double gradient_of(const Evaluated& here, const Terms& squares, std::size_t term,
                                     const Eigen::VectorXd& part) const;
    /// Nothing when no term is fixed and one goes to zero.
    [[nodiscard]] std::optional<TermFit> minimise(const TermSet& set, Terms squares,
                                                  std::size_t fixed) const;
    [[nodiscard]] bool negligible(const TermFit& fit) const;

    std::vector<VariancePoint> points_;
    Eigen::MatrixXd basis_;  ///< points x terms
    Eigen::VectorXd share_;  ///< 1 / sqrt(share)
    CurveCovariance::At covariance_;
};

}  // namespace vibrig::estimator::allan
