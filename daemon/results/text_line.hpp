#pragma once

#include <array>
#include <cstdio>
#include <string>

namespace vibrig::tool {

/// As printf has it; 319 characters at most.
template <class... Values>
[[nodiscard]] std::string printed(const char* format, Values... values) {
    std::array<char, 320> text{};
    std::snprintf(text.data(), text.size(), format, values...);
    return text.data();
}

/// The same, with the end of a line.
template <class... Values>
[[nodiscard]] std::string line(const char* format, Values... values) {
    return printed(format, values...) + "\n";
}

}  // namespace vibrig::tool
