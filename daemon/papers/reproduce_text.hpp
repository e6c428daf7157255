#pragma once

#include <array>
#include <cstdio>
#include <string>

namespace vibrig::tool {

/// printf into a string.
template <typename... Values>
[[nodiscard]] std::string formatted(const char* format, Values... values) {
    std::array<char, 400> out{};
    std::snprintf(out.data(), out.size(), format, values...);
    return out.data();
}

}  // namespace vibrig::tool
