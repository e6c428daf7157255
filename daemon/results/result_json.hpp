#pragma once

#include <string>

#include "estimator/identification/identification.hpp"

namespace vibrig::tool {

/// The JSON form of a result, as `vibrig identify --json` prints it and vibrigd writes it to
/// result.json: one line, keys in fixed order, numbers that read back exactly. What is not
/// observable or does not exist is null, never NaN.
[[nodiscard]] std::string result_json(const estimator::Result& result);

/// True if all 30 coefficients are determined one by one.
[[nodiscard]] bool all_observable(const estimator::Result& result);

}  // namespace vibrig::tool
