#pragma once

#include <string>

#include "daemon/allan/analysis.hpp"

namespace vibrig::tool {

/// Windows of rates that come on standard input, one a line: each is printed when it is complete.
/// True if one was refused or raised an alarm. `page`: an HTML file with the surface of the newest
/// windows and their coefficients, which loads itself again; empty: none. Throws
/// std::exception with what to tell the user.
[[nodiscard]] bool allan_live(const AllanRequest& request, bool json, const std::string& page);

}  // namespace vibrig::tool
