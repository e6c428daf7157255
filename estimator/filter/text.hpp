#pragma once

#include <cstddef>
#include <cstdio>
#include <string>

namespace vibrig::estimator {

/// As printf has it.
template <class... Values>
[[nodiscard]] std::string text(const char* format, Values... values) {
    std::string out(static_cast<std::size_t>(std::snprintf(nullptr, 0, format, values...)), ' ');
    std::snprintf(out.data(), out.size() + 1, format, values...);
    return out;
}

}  // namespace vibrig::estimator
