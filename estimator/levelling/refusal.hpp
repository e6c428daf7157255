#pragma once

#include <cmath>

#include "estimator/filter/text.hpp"
#include "estimator/levelling/design.hpp"

namespace vibrig::estimator::levelling {

/// Throws DesignError naming the value and what was expected, unless `good`.
inline void require(bool good, const char* name, double value, const char* expected) {
    if (!good) throw DesignError(text("%s: %g, expected %s", name, value, expected));
}

inline constexpr double kRounding = 1e-12;  ///< of 0.3, say, that was 3 x 0.1

/// A limit, above 0, to so many digits and never beyond it: who types what a message says is not
/// refused.
[[nodiscard]] inline double at_most(double limit, int digits) {
    const double unit = std::pow(10.0, digits - 1 - std::floor(std::log10(limit)));
    return std::floor(limit * unit * (1 + kRounding)) / unit;
}
[[nodiscard]] inline double at_least(double limit, int digits) {
    const double unit = std::pow(10.0, digits - 1 - std::floor(std::log10(limit)));
    return std::ceil(limit * unit * (1 - kRounding)) / unit;
}

}  // namespace vibrig::estimator::levelling
