#pragma once

#include <cstddef>
#include <string_view>

namespace vibrig::proto {

struct Utf8Character {
    std::size_t length = 0;  ///< bytes; 0: the text does not begin with one
    char32_t code = 0;       ///< of none the byte itself
};

/// The character at the beginning of a text that is not empty. Overlong forms, surrogates and code
/// points above U+10FFFF are none (RFC 3629).
[[nodiscard]] Utf8Character first_character(std::string_view text) noexcept;

}  // namespace vibrig::proto
