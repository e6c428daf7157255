#pragma once

#include <cstddef>
#include <cstdio>
#include <string>

namespace vibrig::proto {

/// As printf has it.
template <class... Values>
[[nodiscard]] std::string printed(const char* format, Values... values) {
    std::string text(static_cast<std::size_t>(std::snprintf(nullptr, 0, format, values...)), ' ');
    std::snprintf(text.data(), text.size() + 1, format, values...);
    return text;
}

}  // namespace vibrig::proto
