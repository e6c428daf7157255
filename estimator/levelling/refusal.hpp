#pragma once

#include <array>
#include <cstdio>
#include <string>

#include "estimator/levelling/design.hpp"

namespace vibrig::estimator::levelling {

/// printf into a string, at most 320 characters.
template <typename... Values>
std::string text(const char* format, Values... values) {
    std::array<char, 320> out{};
    std::snprintf(out.data(), out.size(), format, values...);
    return out.data();
}

/// Throws DesignError naming the value and what was expected, unless `good`.
inline void require(bool good, const char* name, double value, const char* expected) {
    if (!good) throw DesignError(text("%s: %g, expected %s", name, value, expected));
}

}  // namespace vibrig::estimator::levelling
