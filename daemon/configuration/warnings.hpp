#pragma once

#include <string>
#include <vector>

#include "daemon/configuration/configuration.hpp"

namespace vibrig::configuration {

/// "file:line: key: found X, expected Y" of what a real rig is refused for, and a simulated one or
/// a recording is warned of: gyro axes that are hardly meant, motion across the vertical that
/// nobody knows.
[[nodiscard]] std::vector<std::string> warnings(const Loaded& loaded);

}  // namespace vibrig::configuration
