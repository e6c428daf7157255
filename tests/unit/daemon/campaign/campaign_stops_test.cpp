// Dwells that the verdict names are repeated.
#include <algorithm>

#include "tests/unit/daemon/campaign/watched_campaign.hpp"

namespace vibrig::campaign {
namespace {

TEST_F(WatchedCampaign, TheDwellThatTheVerdictNamesIsRepeatedOnceWhereThatIsAskedFor) {
    settings.on_not_valid = OnNotValid::repeat;
    make();
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    const auto recording = [this](std::size_t dwells) {
        for (int n = 0; n < 2000 && orders.size() < dwells; ++n) step();
        return orders.size() == dwells;
    };
    // WHEN the second dwell makes it "not valid" because of the first
    ASSERT_TRUE(recording(2));
    campaign->doubted("not valid: a step", 1, 1);
    // THEN the first is next, at its angles and level, under a number of its own
    ASSERT_TRUE(recording(3));
    EXPECT_EQ(orders[2].dwell.run, 1);
    EXPECT_EQ(orders[2].dwell.position, 5);
    EXPECT_EQ(orders[2].dwell.table_g, orders[0].dwell.table_g);
    EXPECT_EQ(status().position_deg, settings.positions_deg[0]);
    EXPECT_NEAR(status().progress, 2.0 / 5, 0.21);
    // WHEN it is named again, or none is, or one that is not done, THEN it goes on
    campaign->doubted("not valid: a step", 1, 1);
    ASSERT_TRUE(recording(4));
    campaign->doubted("not valid: azimuth");
    ASSERT_TRUE(recording(5));
    campaign->doubted("not valid: azimuth", 7, 7);
    ASSERT_TRUE(run_until(CampaignState::finished, 300)) << status().reason;
    ASSERT_EQ(orders.size(), 5U);
    EXPECT_EQ(status().progress, 1.0);
    EXPECT_EQ(orders[4].dwell.run, 2);
    EXPECT_EQ(orders[4].dwell.position, 2);
    const auto said = [this](const char* text) {
        return std::ranges::count_if(
            events, [&](const std::string& event) { return event.find(text) != event.npos; });
    };
    EXPECT_EQ(said("run 1 position 1 is repeated, as position 5: not valid: a step"), 1);
    EXPECT_EQ(said("run 1 position 1 was repeated before"), 1);
    EXPECT_EQ(said("there is no dwell to repeat"), 2);
    EXPECT_EQ(said("position 5, a repeat: 0, 0, 0 deg"), 1);
}

TEST_F(WatchedCampaign, ADwellThatTheVerdictNamesInTheEndIsRepeatedToo) {
    settings.on_not_valid = OnNotValid::repeat;
    make();
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    for (int n = 0; n < 4000 && orders.size() < 4; ++n) step();
    campaign->doubted("not valid: a step", 2, 2);
    ASSERT_TRUE(run_until(CampaignState::finished, 300)) << status().reason;
    ASSERT_EQ(orders.size(), 5U);
    EXPECT_EQ(orders[4].dwell.position, 5);
    EXPECT_EQ(orders[4].dwell.table_g, orders[3].dwell.table_g);
}

}  // namespace
}  // namespace vibrig::campaign
