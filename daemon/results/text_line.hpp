#pragma once

#include <array>
#include <cstdio>
#include <string>

namespace vibrig::tool {

/// A line of a table, as printf has it; 320 characters at most.
template <class... Values>
[[nodiscard]] std::string line(const char* format, Values... values) {
    std::array<char, 320> text{};
    std::snprintf(text.data(), text.size(), format, values...);
    return std::string(text.data()) + "\n";
}

}  // namespace vibrig::tool
