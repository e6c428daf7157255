#pragma once

#include <string>

#include "daemon/status/status.hpp"

namespace vibrig {

/// Exit status that asks the service manager for the program that is installed now.
inline constexpr int kStartAgain = 75;

/// The file by which an upgrade asks for a restart, in the folder that the service manager made
/// for this service; empty: there is none.
[[nodiscard]] std::string restart_request_file();

/// Why a restart has to wait: something moves, or may. Empty: at rest and disarmed.
[[nodiscard]] std::string restart_waits_for(const StatusData& status);

}  // namespace vibrig
