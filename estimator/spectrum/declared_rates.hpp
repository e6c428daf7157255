#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimator/spectrum/prediction.hpp"
#include "estimator/spectrum/table.hpp"

namespace vibrig::estimator::spectrum {

/// What the declared inputs do to the rates of all dwells.
struct DeclaredRates {
    Eigen::MatrixXd rates;        ///< 3 n x m, one standard uncertainty each
    std::vector<Effect> effects;  ///< of each, without its change
    std::vector<uncertainty::Correlated> correlated;
    /// 3 n x m: this times its transpose is the rates' covariance. Where inputs are correlated its
    /// columns are mixtures of theirs.
    Eigen::MatrixXd root;
};

/// `groups`: the coefficients, `shaken`: the dwells' rates due to
/// vibration, n x 3.
[[nodiscard]] DeclaredRates declared_rates(const Settings& settings, const SpectralTable& table,
                                           const Eigen::MatrixXd& groups,
                                           const Eigen::MatrixXd& shaken);

}  // namespace vibrig::estimator::spectrum
