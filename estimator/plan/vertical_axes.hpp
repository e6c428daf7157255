#pragma once

#include <cstddef>
#include <vector>

#include "estimator/filter/settings.hpp"
#include "estimator/plan/model.hpp"

namespace vibrig::estimator::plan {

/// A position list read for one choice of the platform axis that is vertical at zero gimbal angles.
struct VerticalAxis {
    char axis = 'x';
    std::size_t directions = 0;
    std::size_t rank_one_level = 0, rank = 0;
    double d_efficiency = 0;  ///< against the free choice of directions at 0 and the highest level
};

/// For x, y and z. `levels_g`: at the platform, at least one; each position is at each of them.
[[nodiscard]] std::vector<VerticalAxis> vertical_axes(Settings frame,
                                                      const std::vector<Vec3>& positions,
                                                      const std::vector<double>& levels_g);

}  // namespace vibrig::estimator::plan
