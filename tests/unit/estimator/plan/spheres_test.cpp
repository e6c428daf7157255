#include "estimator/plan/spheres.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "estimator/plan/evaluation.hpp"
#include "estimator/plan/model.hpp"
#include "estimator/plan/positions.hpp"

namespace vibrig::estimator::plan {
namespace {

TEST(Plan, SpheresHoldTheDirectionsInnerFirst) {
    const Problem two = spheres_problem({1, 3});
    ASSERT_EQ(two.size(), 2 * cube_directions().size());
    for (std::size_t i = 0; i < two.size(); ++i) {
        const Row& f = two.points[i].f;
        EXPECT_NEAR(std::hypot(f[1], f[2], f[3]), i < two.size() / 2 ? 1 : 3, 1e-12) << i;
    }
    // One sphere cannot tell D0 from the squares, two can
    EXPECT_EQ(evaluate(spheres_problem({1}), Effort(26, 1)).rank, kTerms - 1);
    EXPECT_EQ(evaluate(two, Effort(52, 1)).rank, kTerms);
}

}  // namespace
}  // namespace vibrig::estimator::plan
