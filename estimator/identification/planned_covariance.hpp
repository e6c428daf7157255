#pragma once

#include <vector>

#include "estimator/filter/linear_algebra.hpp"
#include "estimator/identification/crlb.hpp"

namespace vibrig::estimator {

/// Covariance of the coefficients, filter order, that the prior and a plan leave, for a nominal
/// platform that does not turn.
[[nodiscard]] Covariance planned_covariance(const Settings& settings,
                                            const std::vector<PlannedDwell>& plan, double period_s);

}  // namespace vibrig::estimator
