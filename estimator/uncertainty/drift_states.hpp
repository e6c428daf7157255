#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "estimator/filter/declared.hpp"

namespace vibrig::estimator::uncertainty {

/// One gyro over the dwells of a campaign.
struct GyroRates {
    Eigen::VectorXd time_h, rate, variance;  ///< middle of the dwell, deg/h, (deg/h)^2
    Eigen::MatrixXd regressors;              ///< n x 10, filter order
    Eigen::VectorXd prior_information;       ///< 10, 1 over the prior variances; may be 0
    /// Dwells after which the power was off, each a step as likely as not.
    std::vector<std::size_t> breaks;
    /// What the declared inputs do to the rates, n x m, a standard uncertainty each: no evidence of
    /// a drift. Only DriftLikelihood looks at it.
    Eigen::MatrixXd declared;

    [[nodiscard]] Eigen::Index dwells() const { return rate.size(); }
};

/// How the bias, or the mass unbalance, of a gyro may have moved: sizes in units of the root of
/// the mean variance of a dwell.
struct DriftHypothesis {
    double scatter = 0;  ///< from dwell to dwell
    double walk = 0;     ///< rms at the end
    double trend = 0;    ///< end minus start
    int step_after = 0;  ///< dwells before a step; 0: none
    enum class Unbalance { none, trend, step } unbalance = Unbalance::none;

    [[nodiscard]] bool operator==(const DriftHypothesis&) const = default;
};

/// Probabilities that the data leave, of what the bias did.
struct DriftWeights {
    double none = 1, scatter = 0, walk = 0, trend = 0, step = 0, unbalance = 0;
};

struct DriftStep {
    int after_dwell = 0;                     ///< most likely place; 0: none
    double weight = 0, size = 0, sigma = 0;  ///< deg/h
};

/// Coefficients of one gyro, averaged over what the bias may have done. The constant is its mean
/// over the dwells.
struct DriftAverage {
    Eigen::VectorXd value;       ///< 10
    Eigen::MatrixXd covariance;  ///< 10 x 10
    Eigen::MatrixXd gain;        ///< value = gain * rates
    double log_evidence = 0;     ///< of the rates, over all hypotheses; of the same n dwells
    DriftWeights weights;
    DriftStep step;
    double trend_deg_h_h = 0;  ///< steady, over all hypotheses; what walks is not in it
    double bias_now = 0, bias_now_sigma = 0;                    ///< at the last dwell, deg/h
    std::vector<std::pair<DriftHypothesis, double>> likeliest;  ///< with their weights
};

/// The unit of a drift's sizes, from the variances of a gyro's rates: what equal dwells are known
/// to, deg/h. One that was cut short knows next to nothing and does not set it for the others.
[[nodiscard]] double unit_of(const Eigen::VectorXd& variance);

[[nodiscard]] DriftAverage average_drift(const GyroRates& gyro, const Drift& drift);

/// Covariance of the rates about their model, n x n: noise, and what the bias may have done by
/// `average`.
[[nodiscard]] Eigen::MatrixXd mean_covariance(const GyroRates& gyro, const DriftAverage& average);

/// The same, as a regression takes it: what scatters from dwell to dwell, (deg/h)^2, and columns of
/// unit prior variance, n x m with m at most 40 and a few whatever n is.
struct DriftColumns {
    double scatter = 0;
    Eigen::MatrixXd columns;
};
[[nodiscard]] DriftColumns drift_columns(const GyroRates& gyro, const DriftAverage& average);

/// Logarithm of the likelihood ratio of a covariance with these sizes of scatter and walk over that
/// of noise alone, for the same rates.
class DriftLikelihood {
  public:
    explicit DriftLikelihood(const GyroRates& gyro);
    [[nodiscard]] double ratio_of_scatter(double size) const;
    [[nodiscard]] double ratio_of_walk(double size) const;

  private:
    const GyroRates& gyro_;
    double none_ = 0;
};

}  // namespace vibrig::estimator::uncertainty
