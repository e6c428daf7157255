#pragma once

#include "proto/dbc_scanner.hpp"

namespace vibrig::proto {

/// True for statements that carry nothing Vibrig uses; they are passed over up to their ';'.
[[nodiscard]] bool is_passed_over(const Token& token) noexcept;
/// True for every word that begins a DBC statement.
[[nodiscard]] bool is_keyword(const Token& token) noexcept;

}  // namespace vibrig::proto
