#pragma once

#include "estimator/uncertainty/assessment.hpp"

namespace vibrig::estimator::uncertainty {

/// What the rules say of an assessment that is complete but for its verdict.
[[nodiscard]] Verdict judge(const Settings& settings, const Result& result,
                            const Assessment& assessed, Stage stage);

}  // namespace vibrig::estimator::uncertainty
