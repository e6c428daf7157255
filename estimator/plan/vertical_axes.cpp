#include "estimator/plan/vertical_axes.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "estimator/plan/evaluation.hpp"
#include "estimator/plan/optimum.hpp"
#include "estimator/plan/positions.hpp"

namespace vibrig::estimator::plan {

namespace {

constexpr double kSameDirection = 1e-6;

}  // namespace

std::vector<VerticalAxis> vertical_axes(Settings frame, const std::vector<Vec3>& positions,
                                        const std::vector<double>& levels_g) {
    Problem free;
    const double highest = *std::max_element(levels_g.begin(), levels_g.end());
    for (const double level : {0.0, highest > 0 ? highest : 1.0}) {
        for (const Vec3& direction : cube_directions())
            free.points.push_back({vibration_row(direction, level)});
    }
    const double optimum = d_optimum(free).log_det;
    std::vector<VerticalAxis> result;
    for (int axis = 0; axis < 3; ++axis) {
        VerticalAxis row;
        row.axis = "xyz"[axis];
        frame.up = {axis, 1};
        std::set<std::array<long, 3>> directions;
        Problem one, all;
        for (const double level : levels_g) {
            for (const Vec3& position : positions) {
                const Vec3 up = up_at(frame, position);
                directions.insert({std::lround(up[0] / kSameDirection),
                                   std::lround(up[1] / kSameDirection),
                                   std::lround(up[2] / kSameDirection)});
                all.points.push_back({vibration_row(up, level)});
                if (level == levels_g.back()) one.points.push_back(all.points.back());
            }
        }
        const auto whole = evaluate(all, Effort(all.size(), 1.0));
        row.directions = directions.size();
        row.rank_one_level = evaluate(one, Effort(one.size(), 1.0)).rank;
        row.rank = whole.rank;
        row.d_efficiency = d_efficiency(whole, optimum);
        result.push_back(row);
    }
    return result;
}

}  // namespace vibrig::estimator::plan
