#include "estimator/plan/spheres.hpp"

#include "estimator/plan/positions.hpp"

namespace vibrig::estimator::plan {

Problem spheres_problem(const std::vector<double>& spheres, const Terms& terms) {
    Problem problem;
    problem.terms = terms;
    for (const double radius : spheres) {
        for (Vec3 x : cube_directions()) {
            for (double& value : x) value *= radius;
            problem.points.push_back({turntable_row(x)});
        }
    }
    return problem;
}

}  // namespace vibrig::estimator::plan
