#pragma once

#include <string>
#include <vector>

#include "estimator/plan/model.hpp"

namespace vibrig::tool::planner {

/// All ten terms but these. Throws std::runtime_error for a name that is none, with the option's.
[[nodiscard]] estimator::plan::Terms terms_without(const std::vector<std::string>& names);

}  // namespace vibrig::tool::planner
