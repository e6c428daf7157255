#pragma once

#include <toml++/toml.h>

#include <array>
#include <optional>
#include <string>

#include "daemon/configuration/key.hpp"
#include "daemon/configuration/problems.hpp"

namespace vibrig::configuration {

[[nodiscard]] Place place_of(const toml::source_region& source);

/// The value as a person wrote it, with its type when that is the problem: `"fast" (a string)`.
[[nodiscard]] std::string describe(const toml::node& node);

/// "a number from 2 to 600 s"
[[nodiscard]] std::string expected_number(Range range, const std::string& unit);

/// Reads a finite number within the range (a TOML integer will do) or adds a problem.
[[nodiscard]] std::optional<double> read_number(const toml::node& node, const std::string& key,
                                                Range range, const std::string& unit,
                                                Problems& problems);
[[nodiscard]] std::optional<std::array<double, 3>> read_triple(const toml::node& node,
                                                               const std::string& key,
                                                               const std::array<Range, 3>& ranges,
                                                               const std::string& unit,
                                                               Problems& problems);
/// An array of `low` to `high` elements or a problem and nullptr.
[[nodiscard]] const toml::array* read_array(const toml::node& node, const std::string& key,
                                            std::size_t low, std::size_t high,
                                            const std::string& elements, Problems& problems);

/// Shortest TOML that reads back as the same number.
[[nodiscard]] std::string write_number(double value);
[[nodiscard]] std::string write_triple(const std::array<double, 3>& value);
[[nodiscard]] std::string write_text(const std::string& value);
/// JSON Schema of one number.
[[nodiscard]] std::string schema_of(Range range);
/// JSON Schema of an array of `low` to `high` elements.
[[nodiscard]] std::string schema_of_array(const std::string& element, std::size_t low,
                                          std::size_t high);
/// A bound as a person would write it: no ".0".
[[nodiscard]] std::string plain(double value);
/// For people: five significant digits are plenty for a limit.
[[nodiscard]] std::string rounded(double value);

}  // namespace vibrig::configuration
