#pragma once

#include <string>
#include <vector>

#include "estimator/plan/model.hpp"

namespace vibrig::tool::planner {

/// All ten terms but these. Throws std::runtime_error, with the option's name, for a name that is
/// none, and where no term is left.
[[nodiscard]] estimator::plan::Terms terms_without(const std::vector<std::string>& names);

}  // namespace vibrig::tool::planner
