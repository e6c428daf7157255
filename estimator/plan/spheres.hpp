#pragma once

#include <vector>

#include "estimator/plan/model.hpp"

namespace vibrig::estimator::plan {

/// On a turntable or centrifuge: the 26 directions of the cube on every sphere, inner first; faces,
/// edges, corners in this order.
[[nodiscard]] Problem spheres_problem(const std::vector<double>& spheres,
                                      const Terms& terms = kAllTerms);

}  // namespace vibrig::estimator::plan
