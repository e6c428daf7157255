#pragma once

#include "daemon/tool/reproduce.hpp"

namespace vibrig::tool::zha2019::drives {

/// Six simulated drives in place of the paper's, whose data are not published: rows for Tables 1
/// and 2, and what damping without a reference does under way (eq. 1, Figure 2).
void add_vehicle(Reproduction& table);
/// Charts of the starts, the four hours and a drive.
void add_charts(Reproduction& table);

}  // namespace vibrig::tool::zha2019::drives
