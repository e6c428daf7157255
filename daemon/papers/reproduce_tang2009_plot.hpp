#pragma once

#include <string>

#include "daemon/papers/reproduce_tang2009_study.hpp"

namespace vibrig::tool::tang2009 {

/// Charts like the paper's Figure 3, one for each trial, gyro and route of a study. Throws
/// std::runtime_error naming the path.
void plot_convergence(const Study& study, const std::string& folder);

}  // namespace vibrig::tool::tang2009
