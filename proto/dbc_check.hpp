#pragma once

#include <vector>

#include "proto/dbc.hpp"
#include "proto/dbc_scanner.hpp"

namespace vibrig::proto {

/// Rules that need the whole message: multiplexing is complete and no two signals share a bit
/// unless their multiplex values keep them apart. `places` holds where each signal's name stands.
void check_message(const Message& message, const std::vector<Position>& places,
                   const DbcScanner& scanner);

/// True if all bits lie inside a payload of `size` bytes.
[[nodiscard]] bool fits_message(const Signal& signal, unsigned size) noexcept;

}  // namespace vibrig::proto
