#pragma once

#include <string>

#include "estimator/identification.hpp"
#include "estimator/uncertainty/assessment.hpp"

namespace vibrig::tool {

/// A result for people: the 30 coefficients, the amplitudes, what could not be told apart, the
/// verdict, warnings.
[[nodiscard]] std::string result_table(const estimator::Result& result,
                                       const estimator::uncertainty::Assessment& assessed);

}  // namespace vibrig::tool
