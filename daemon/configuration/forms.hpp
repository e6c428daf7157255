#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace vibrig::configuration {

struct Loaded;

/// What stands in the file of format_essentials() for what only the rig's people know; no key takes
/// it.
inline constexpr const char* kBlank = "FILL IN";

/// A commented TOML file of the keys that a rig needs: blanks, each with an example, and defaults.
[[nodiscard]] std::string format_essentials();

/// JSON Schema (2020-12) of the file, for editors and for the reference: "x-type", "x-unit",
/// "x-bounds" and "x-meaning" say of a key what vibrigd --schema does, "x-conditions" what an
/// interlock row may watch, "x-rows" the rows in force by default.
[[nodiscard]] std::string format_json_schema();

/// The table of --check for machines: a list of {"key", "value", "unit", "origin", "meaning"}, the
/// values numbers, strings, lists and tables.
[[nodiscard]] nlohmann::ordered_json effective_json(const Loaded& loaded);

}  // namespace vibrig::configuration
