#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "estimator/spectrum/elastic.hpp"
#include "estimator/spectrum/swept_rates.hpp"
#include "estimator/spectrum/table.hpp"

namespace vibrig::estimator::spectrum {

/// One gyro: rates with their covariance, deg/h.
struct GyroProblem {
    Eigen::VectorXd rate;         ///< n
    Eigen::MatrixXd covariance;   ///< n x n
    Eigen::VectorXd prior_sigma;  ///< 10, filter order
    std::vector<SweptRates> swept{};
    /// n x inputs: what each declared input does to the rates with its sigma. Not in `covariance`;
    /// a resonance is weighed with it.
    Eigen::MatrixXd declared{};
};

/// Coefficients for given resonances: 10 static ones (filter order), then six elastic ones for
/// each. What the data leave open of the resonances themselves is in the mixture, or, with
/// `linearised`, in the last columns of the covariance: ln hz of each, then ln damping.
struct Hypothesis {
    double weight = 1;
    std::vector<Resonance> resonances;
    Eigen::VectorXd x;
    Eigen::MatrixXd covariance;
    bool linearised = false;
};

struct Interval {
    double low = 0, high = 0;
};

/// What the rates of a gyro leave of its elastic part.
struct Mixture {
    /// Weights of sum 1. Those of the likelier model, none or one resonance, come first, whatever
    /// one of them alone weighs; within a model the heaviest first.
    std::vector<Hypothesis> list;
    double log_odds = 0;    ///< of one resonance against none
    double chi_square = 0;  ///< of the first hypothesis, on `covariance`
    int degrees = 0;
    Interval hz, damping;  ///< of one resonance: quantiles of 2.5 and 97.5 % where there is one

    [[nodiscard]] bool named() const { return log_odds > 4; }
    /// The likelier model has a resonance.
    [[nodiscard]] bool resonant() const { return !list.front().resonances.empty(); }
};

/// No resonance; as good as any where all dwells shook alike.
[[nodiscard]] Hypothesis without_resonance(const SpectralTable& table, std::size_t gyro,
                                           const GyroProblem& problem);
/// None, or one: a mixture over its frequency and damping.
[[nodiscard]] Mixture one_resonance(const SpectralTable& table, std::size_t gyro,
                                    const GyroProblem& problem);
/// Two, by Gauss and Newton's method from several starts, `first` the frequency of one; of
/// the rates of dwells and sweeps together. Chi-square and its degrees are of the dwells.
[[nodiscard]] Mixture two_resonances(const SpectralTable& table, std::size_t gyro,
                                     const GyroProblem& problem, double first_hz);

/// Design matrix of a gyro's sweep, whitened, n x (10 + 6 m).
[[nodiscard]] Eigen::MatrixXd swept_design(const SweptRates& swept,
                                           const std::vector<Resonance>& resonances);
/// Design matrix of a gyro, n x (10 + 6 m).
[[nodiscard]] Eigen::MatrixXd design(const SpectralTable& table, std::size_t gyro,
                                     const std::vector<Resonance>& resonances);
/// x = gain * rates of a hypothesis, its resonances kept: (10 + 6 m) x n.
[[nodiscard]] Eigen::MatrixXd gain(const SpectralTable& table, std::size_t gyro,
                                   const GyroProblem& problem, const Hypothesis& of);

/// Mean, standard deviation and 95 % interval of a resonance over a mixture's resonant part; the
/// interval has 2.5 % of it on either side, and no frequency outside the prior's.
struct Spread {
    double mean = 0, sigma = 0, low = 0, high = 0;
};
struct ResonanceEstimate {
    Spread hz, damping;
    Eigen::Matrix<double, kElastic, 1> elastic, sigma;
};
/// One for each resonance of the likelier model.
[[nodiscard]] std::vector<ResonanceEstimate> estimates(const Mixture& mixture);

/// Prior of ln damping, and of an elastic coefficient in deg/h/g^2, half each.
inline constexpr double kDamping = 0.05, kDampingSpread = 0.9;
inline constexpr std::array<double, 2> kElasticSizes{0.01, 0.05};
inline constexpr double kLowestResonance = 15, kHighestResonance = 500;

}  // namespace vibrig::estimator::spectrum
