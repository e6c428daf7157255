#pragma once

#include "daemon/papers/reproduce.hpp"
#include "daemon/papers/reproduce_tang2009_study.hpp"

namespace vibrig::tool::tang2009 {

/// Charts like the paper's Figure 3, one for each trial, gyro and route of a study.
void add_convergence(const Study& study, Reproduction& table);

}  // namespace vibrig::tool::tang2009
