#include "daemon/archive/type_statistics.hpp"

#include <gtest/gtest.h>

#include "tests/unit/daemon/archive/entries.hpp"

namespace vibrig::archive {
namespace {

TEST(TypeStatistics, RestOnCampaignsOfOneVibration) {
    const std::vector<Entry> campaigns{entry_of("1", 0, 4, 0.1, 25), entry_of("2", 1, 1, 0.1, 15),
                                       entry_of("2", 2, 4, 0.1, 25), entry_of("3", 3, 2, 0.1, 0),
                                       entry_of("3", 4, 1, 0.1, 15), entry_of("4", 5, 4, 0.1, 25)};
    // As the newest one's, without those of the unit of which something is to be predicted
    const auto newest = by_unit(campaigns, "4", false);
    EXPECT_EQ(newest.vibration, "at 15 Hz");
    EXPECT_EQ(newest.campaigns, 2U);
    EXPECT_EQ(newest.of_other_vibration, 3U);
    EXPECT_EQ(newest.left_out, 0U);
    ASSERT_EQ(newest.units.size(), 2U);
    for (const auto& unit : newest.units) EXPECT_EQ(unit.at(0).value(4), 1);
    // OR of the frequency that is asked for
    const auto asked = by_unit(campaigns, "4", false, all_at(25));
    EXPECT_EQ(asked.vibration, "at 25 Hz");
    EXPECT_EQ(asked.campaigns, 2U);
    EXPECT_EQ(asked.of_other_vibration, 3U);
    EXPECT_EQ(by_unit(campaigns, "4", false, all_at(33)).campaigns, 0U);
}

}  // namespace
}  // namespace vibrig::archive
