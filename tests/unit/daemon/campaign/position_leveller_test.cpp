#include "daemon/campaign/position_leveller.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

namespace vibrig::campaign {
namespace {

TEST(LevellingBlock, IsATenthOfASecondAtEveryRateThatIsStated) {
    EXPECT_EQ(levelling_block(0.025), 4U);
    EXPECT_EQ(levelling_block(0.01), 10U);
    EXPECT_EQ(levelling_block(1), 1U);
    EXPECT_THROW((void)levelling_block(0), std::invalid_argument);
}

}  // namespace
}  // namespace vibrig::campaign
