#pragma once

#include <vector>

#include "daemon/papers/reproduce.hpp"

namespace vibrig::tool::tang2009 {

/// Eqs 3-7: transmission of the isolators and its transient, against the integrated equation 1.
void add_transmission(Reproduction& table);
/// Section 3.5: what errors of the accelerometers do to the level.
void add_level_errors(Reproduction& table);

}  // namespace vibrig::tool::tang2009
