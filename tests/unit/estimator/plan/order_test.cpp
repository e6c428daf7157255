#include "estimator/plan/order.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <vector>

#include "estimator/plan/evaluation.hpp"
#include "estimator/plan/positions.hpp"

namespace vibrig::estimator::plan {
namespace {

TEST(Plan, OrdersSaveTravelOrBalanceDrift) {
    std::vector<Visit> visits;
    std::vector<Row> rows;
    for (const Vec3& u : cube_directions()) {
        for (const double level : {0.0, 6.0}) {
            visits.push_back({*position_for({}, u, {}), level});
            rows.push_back(vibration_row(u, level));
        }
    }
    Order listed(visits.size());
    std::iota(listed.begin(), listed.end(), std::size_t{0});
    const Order travel = shortest_travel(visits, {});
    const Order random = randomised(rows, 8, 1);
    for (const Order& order : {travel, random}) {
        Order sorted = order;
        std::sort(sorted.begin(), sorted.end());
        EXPECT_EQ(sorted, listed) << "every run once";
    }
    EXPECT_LT(duration(visits, travel, {}).slewing_s, duration(visits, listed, {}).slewing_s);
    EXPECT_LT(drift_imbalance(rows, random), 0.2);
    const Duration d = duration({visits[0], visits[1]}, {0, 1}, {100, 3, 2, 5, 1.5});
    const double slew = slew_s({}, visits[0].position_deg, {});
    EXPECT_NEAR(d.total_s, slew + 2 * 104.5 + 4, 1e-9) << "one at rest, one with ramps";
    EXPECT_NEAR(d.vibrating_s, 107, 1e-9);
}

}  // namespace
}  // namespace vibrig::estimator::plan
