#pragma once

#include <vector>

#include "estimator/uncertainty/drift_states.hpp"

namespace vibrig::estimator::uncertainty {

struct WeightedHypothesis {
    DriftHypothesis what;
    double weight;  ///< before the rates
};

/// Ways in which the bias, or the mass unbalance, of a gyro may have moved, in units of `s0` deg/h:
/// one, where the model of the drift is given or the dwells are too few to tell them apart
/// (docs/theory/uncertainty.md).
[[nodiscard]] std::vector<WeightedHypothesis> drift_hypotheses(const GyroRates& gyro,
                                                               const Drift& drift, double s0);

}  // namespace vibrig::estimator::uncertainty
