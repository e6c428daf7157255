#pragma once

#include <array>
#include <vector>

#include "estimator/commissioning/gravity.hpp"

namespace vibrig::estimator::commissioning {

/// The classes, best first, with cost, rms and ln ratio. A class that is far beyond the best has
/// the cost of a free matrix only, which is a lower bound of its own.
[[nodiscard]] std::vector<Hypothesis> fit_classes(const std::vector<Stop>& stops,
                                                  const std::array<std::vector<int>, 3>& units,
                                                  const GravitySettings& settings);

}  // namespace vibrig::estimator::commissioning
