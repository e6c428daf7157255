#pragma once

#include <Eigen/Core>
#include <limits>
#include <utility>
#include <vector>

#include "estimator/spectrum/table.hpp"
#include "estimator/uncertainty/drift_states.hpp"

namespace vibrig::estimator::spectrum {

/// Rates of all gyros, element 3 k + j, against one set of quadratic coefficients and against one
/// for every kind of vibration.
struct Flatness {
    double chi_square = 0;  ///< of the flat model less that of the groups
    int degrees = 0;        ///< 18 (F - 1)
    double p = std::numeric_limits<double>::quiet_NaN();
    bool alarm = false;
    double grouped_chi_square = 0;
    /// For a resonance at so many Hz the share of all quadratic coefficients, elastic, that is seen
    /// with 90 %.
    std::vector<std::pair<double, double>> smallest_seen;
    /// Frequency up to which the plan would see a share of 20 %.
    double highest_hz = 0;
};

inline constexpr double kAlarm = 1e-3;

/// Coefficients of the groups model, one gyro a column: (4 + 6 F) x 3.
struct Groups {
    Eigen::MatrixXd value, sigma;
};

/// Covariance, n x n, of one gyro's rates about flat coefficients. Slow changes of the bias are
/// weighed by how well they go with flat coefficients, which leave many more rates to tell them by
/// than the groups do; the scatter by the groups, since what is not flat scatters about what is.
/// `gyro`, `of_groups`: with the groups' columns; `base`, `prior_sigma`: the flat ones.
[[nodiscard]] Eigen::MatrixXd covariance_if_flat(const uncertainty::GyroRates& gyro,
                                                 const uncertainty::DriftAverage& of_groups,
                                                 const Eigen::MatrixXd& base,
                                                 const Eigen::VectorXd& prior_sigma,
                                                 const uncertainty::Drift& drift);

/// `covariance`: 3 n x 3 n, everything that is declared included; `prior_sigma`: 10 x 3, filter
/// order. `scattered`: the dwells scatter beyond their noise; then the alarm needs an F test too.
[[nodiscard]] Flatness test_flatness(const SpectralTable& table, const Eigen::VectorXd& rates,
                                     const Eigen::MatrixXd& covariance,
                                     const Eigen::MatrixXd& prior_sigma, bool scattered);

/// All rates about coefficients for every kind of vibration; `degrees`: less what is determined.
struct GroupedFit {
    double chi_square = 0;
    int degrees = 0;
    double p = 1;                ///< that it is by chance
    std::size_t worst_rate = 0;  ///< where p is an alarm: element without which the others fit best
};
/// As in the test of flatness; `covariance` without a drift: one that is there is told by it.
[[nodiscard]] GroupedFit fit_groups(const SpectralTable& table, const Eigen::VectorXd& rates,
                                    const Eigen::MatrixXd& covariance,
                                    const Eigen::MatrixXd& prior_sigma);

/// Prior of the groups model: that of the base for every group.
[[nodiscard]] Eigen::VectorXd grouped_prior(const Eigen::VectorXd& base, Eigen::Index columns);

}  // namespace vibrig::estimator::spectrum
