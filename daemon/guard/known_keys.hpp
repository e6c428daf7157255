#pragma once

#include <set>
#include <string>

namespace vibrig::guard {

/// Keys of the tables in which the guard reads too, and that are the daemon's alone: the guard
/// knows their names, so that it can tell a key of neither.
[[nodiscard]] const std::set<std::string>& keys_of_the_daemon();
/// Tables (and lists) of the file in which the guard reads nothing.
[[nodiscard]] const std::set<std::string>& tables_of_the_daemon();

}  // namespace vibrig::guard
