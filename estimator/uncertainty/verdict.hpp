#pragma once

#include "estimator/uncertainty/assessment.hpp"

namespace vibrig::estimator::uncertainty {

/// What the rules say of an assessment that is complete but for its verdict. `fit`: the null fit;
/// `gain0`: 30 x 3 n of a constant bias, filter order.
[[nodiscard]] Verdict judge(const Settings& settings, const Result& result,
                            const Assessment& assessed, const Eigen::MatrixXd& gain0);

}  // namespace vibrig::estimator::uncertainty
