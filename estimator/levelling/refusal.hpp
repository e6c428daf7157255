#pragma once

#include "estimator/filter/text.hpp"
#include "estimator/levelling/design.hpp"

namespace vibrig::estimator::levelling {

/// Throws DesignError naming the value and what was expected, unless `good`.
inline void require(bool good, const char* name, double value, const char* expected) {
    if (!good) throw DesignError(text("%s: %g, expected %s", name, value, expected));
}

}  // namespace vibrig::estimator::levelling
