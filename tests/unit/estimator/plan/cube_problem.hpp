#pragma once

#include <vector>

#include "estimator/plan/evaluation.hpp"
#include "estimator/plan/positions.hpp"

namespace vibrig::estimator::plan {

inline Problem rig(const std::vector<double>& levels) {
    Problem problem;
    for (const double level : levels) {
        for (const Vec3& u : cube_directions()) problem.points.push_back({vibration_row(u, level)});
    }
    return problem;
}

inline Effort ones(const Problem& problem) { return Effort(problem.size(), 1.0); }

}  // namespace vibrig::estimator::plan
