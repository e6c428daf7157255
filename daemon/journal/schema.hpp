#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace vibrig::journal {

class Database;

/// 1: without a chain.
inline constexpr std::int64_t kSchemaVersion = 2;

/// Tables whose rows are chained: all that say something.
inline constexpr std::array kChained{"origin",  "campaign",   "dwell",  "event", "commissioning",
                                     "command", "loop_check", "safety", "proof"};
/// Came later: a file of this version that never had it has none.
inline constexpr const char* kCommissioning = "commissioning";

/// What stands in the table safety.
inline constexpr const char* kArmed = "armed";
inline constexpr const char* kDisarmed = "disarmed";
inline constexpr const char* kLatched = "latched";
inline constexpr const char* kFirst = "acknowledged by the first";
inline constexpr const char* kOver = "acknowledged";

/// What stands in the table command, as its kind.
inline constexpr const char* kCertificate = "certificate";

/// Those that are not there yet.
void make_tables(Database& database);
/// Where an earlier release had none yet.
void make_commissioning(Database& database);
[[nodiscard]] bool has_table(Database& database, const char* name);
/// One that was there has gone.
[[nodiscard]] bool lacks_table(Database& database, const char* name);
/// What the file has beside its tables, a trigger for example, by name.
[[nodiscard]] std::vector<std::string> strange_objects(Database& database);

}  // namespace vibrig::journal
