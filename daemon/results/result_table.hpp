#pragma once

#include <string>

#include "estimator/identification/identification.hpp"

namespace vibrig::tool {

/// A result for people: the 30 coefficients, the amplitudes, what could not be told apart,
/// warnings.
[[nodiscard]] std::string result_table(const estimator::Result& result);

}  // namespace vibrig::tool
