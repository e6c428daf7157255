#pragma once

#include <array>
#include <vector>

#include "estimator/uncertainty/fit.hpp"

namespace vibrig::estimator::uncertainty {

/// Campaign whose dwells say that a bias has moved.
struct DriftingCampaign {
    const DwellTable& table;
    const std::array<GyroRates, 3>& gyros;
    const std::array<DriftAverage, 3>& averages;  ///< of `gyros`
    const Drift& drift;
    const Eigen::MatrixXd& declared;  ///< as NullFit has it
    const Eigen::VectorXd& prior_information;
    int freed = 0;
};

/// Structural patterns, each with all that the biases may have done beside it against that alone
/// (docs/theory/uncertainty.md); the best first. A drift takes up what a misfit does to the fit,
/// not what it does to the coefficients.
[[nodiscard]] std::vector<Evidence> weigh_beside_drift(const DriftingCampaign& campaign,
                                                       const ForwardModel& model);

}  // namespace vibrig::estimator::uncertainty
