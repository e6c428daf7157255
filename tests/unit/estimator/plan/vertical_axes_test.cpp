#include "estimator/plan/vertical_axes.hpp"

#include <gtest/gtest.h>

namespace vibrig::estimator::plan {
namespace {

TEST(Plan, AVerticalAxisIsJudgedByTheDirectionsThatItGives) {
    // GIVEN turns about the azimuth axis alone: upright it leaves the vertical where it is
    const auto rows = vertical_axes({}, {{0, 0, 0}, {0, 0, 90}, {0, 0, 180}}, {0, 6});
    ASSERT_EQ(rows.size(), 3U);
    for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(rows[k].axis, "xyz"[k]);
    EXPECT_EQ(rows[0].directions, 3U);
    EXPECT_EQ(rows[1].directions, 3U);
    EXPECT_EQ(rows[2].directions, 1U);
    // THEN one direction at two levels tells two combinations apart
    EXPECT_EQ(rows[2].rank_one_level, 1U);
    EXPECT_EQ(rows[2].rank, 2U);
}

}  // namespace
}  // namespace vibrig::estimator::plan
