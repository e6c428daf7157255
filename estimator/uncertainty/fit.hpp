#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "estimator/filter/linear_algebra.hpp"
#include "estimator/uncertainty/drift_states.hpp"
#include "estimator/uncertainty/signatures.hpp"

namespace vibrig::estimator::uncertainty {

/// The dwells against the model: noise and declared inputs only, coefficients constant.
class NullFit {
  public:
    /// `declared`: 3 n x m, a standard uncertainty each; `prior_information`: 30, filter order.
    /// `freed`: unknowns among the declared ones that the data determine.
    NullFit(const DwellTable& table, const Eigen::MatrixXd& declared,
            const Eigen::VectorXd& prior_information, int freed = 0);

    /// Chi-square of the rates about the model.
    [[nodiscard]] double chi_square() const { return chi_square_; }
    /// Rates less determined coefficients.
    [[nodiscard]] int degrees() const { return degrees_; }
    /// Coefficients of constant bias, filter order, and their covariance.
    [[nodiscard]] const Eigen::VectorXd& value() const { return value_; }
    [[nodiscard]] const Eigen::MatrixXd& covariance() const { return covariance_; }
    /// What rates that are so much larger do to them.
    [[nodiscard]] Eigen::VectorXd change(const Eigen::VectorXd& rates) const;
    /// y - H D and its variance, 3 n.
    [[nodiscard]] Eigen::VectorXd residual(const Eigen::VectorXd& coefficients) const;
    /// With the first so many declared ones.
    [[nodiscard]] Eigen::VectorXd residual_variance(Eigen::Index declared) const;

    /// s = z' Q0 y and F = z' Q0 z of some signatures.
    struct Projection {
        Eigen::VectorXd s;
        Eigen::MatrixXd f;
    };
    [[nodiscard]] Projection project(const Eigen::MatrixXd& z) const;
    /// Q0 z, 3 n x unknowns.
    [[nodiscard]] Eigen::MatrixXd weights(const Eigen::MatrixXd& z) const;

  private:
    [[nodiscard]] Eigen::MatrixXd whitened(const Eigen::MatrixXd& x) const;
    [[nodiscard]] Eigen::MatrixXd left(const Eigen::MatrixXd& white) const;

    DwellTable table_;
    Eigen::MatrixXd h_, declared_;            ///< 3 n x 30, 3 n x m
    Eigen::MatrixXd white_;                   ///< both, whitened
    std::vector<Eigen::Matrix3d> whitening_;  ///< of each dwell
    std::optional<linear_algebra::Cholesky> normal_;
    Eigen::VectorXd y_left_, value_;
    Eigen::MatrixXd covariance_;
    double chi_square_ = 0;
    int degrees_ = 0;
};

/// Regressors of all rates, 3 n x 30, filter order.
[[nodiscard]] Eigen::MatrixXd all_regressors(const DwellTable& table);
[[nodiscard]] Eigen::VectorXd all_rates(const DwellTable& table);

/// Slopes within the dwells about those of the model: chi-square with 3 n degrees, and of each
/// gyro the weighted mean with its sigma, deg/h per 100 s.
struct RampFit {
    double chi_square = 0;
    std::size_t degrees = 0;
    std::array<double, 3> mean{}, sigma{};
    [[nodiscard]] double log_evidence() const;
};
[[nodiscard]] RampFit fit_ramps(const DwellTable& table, const Eigen::VectorXd& coefficients);

/// A misfit as the rates of a campaign show it.
using Pattern = Misfit;
inline constexpr std::size_t kPatterns = kMisfits;
[[nodiscard]] const char* name_of(Pattern pattern) noexcept;
/// It moves the coefficients, and no state of the drift takes it up.
[[nodiscard]] bool is_structural(Pattern pattern) noexcept;

/// What the data say for a pattern against nothing, and how large it is then.
struct Evidence {
    Pattern pattern = Pattern::cross_axis;
    double log_odds = 0;
    int after_dwell = 0;  ///< of a step
    std::vector<std::string> elements;
    std::vector<double> size, sigma;  ///< in `unit`
    const char* unit = "";
    Eigen::VectorXd rates;     ///< of this size, 3 n
    Eigen::VectorXd change;    ///< of the coefficients of constant bias, filter order
    double smallest_seen = 0;  ///< of its best seen unknown, with 90 %

    static constexpr double kNamedFrom = 4;
    /// Odds enough to be named.
    [[nodiscard]] bool named() const { return log_odds > kNamedFrom; }
};

/// One pattern by its signatures.
[[nodiscard]] Evidence weigh(Pattern pattern, const Signatures& of, const NullFit& fit);
/// Logarithm of what the prior of a pattern's unknowns leaves of its likelihood at their best.
[[nodiscard]] double log_occam(const Signatures& of, const NullFit& fit, const Evidence& found);

/// All patterns, the best first. `coefficients`: filter order, with which signatures are taken.
[[nodiscard]] std::vector<Evidence> weigh_patterns(const DwellTable& table, const NullFit& fit,
                                                   const RampFit& ramps, const ForwardModel& model,
                                                   const std::array<GyroRates, 3>& gyros);

}  // namespace vibrig::estimator::uncertainty
