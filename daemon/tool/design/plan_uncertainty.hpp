#pragma once

#include <vector>

#include "estimator/uncertainty/assessment.hpp"
#include "estimator/uncertainty/balanced_order.hpp"

namespace vibrig::tool::planner {

/// What a plan allows with the inputs as they are declared, before anything is shaken.
struct PlanUncertainty {
    estimator::uncertainty::Assessment assessed;  ///< without noise, typical coefficients
    estimator::uncertainty::OrderMerit merit;
};

/// `visits` in their order, levels at the platform; `period_s` between samples. Coefficients as
/// those of Table 2 of Tang et al. 2009: 1 deg/h, 1 deg/h/g, 0.03 deg/h/g^2.
[[nodiscard]] PlanUncertainty plan_uncertainty(const estimator::Settings& settings,
                                               const std::vector<estimator::plan::Visit>& visits,
                                               const estimator::plan::Timing& timing,
                                               double period_s);

}  // namespace vibrig::tool::planner
