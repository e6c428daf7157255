#pragma once

#include <string>
#include <vector>

namespace vibrig::archive {

/// Versions of an index: the statements that lead from one to the next, the same for SQLite and
/// PostgreSQL. The first is what recordings.sqlite3 was before it had a number: such a file becomes
/// version 1 as it is, and the daemon that writes it needs to know nothing of the others.
[[nodiscard]] const std::vector<std::vector<std::string>>& migrations();
[[nodiscard]] int newest_version();

}  // namespace vibrig::archive
