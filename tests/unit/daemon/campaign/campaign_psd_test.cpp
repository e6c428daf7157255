#include "tests/unit/daemon/campaign/random_dwell.hpp"

namespace vibrig::campaign {
namespace {

/// What was played is asked for at rest, before anything moves again.
struct PsdDwellTest : RandomDwellTest {
    PsdDwellTest() {
        settings.stops.push_back({{0, 0, 90}, 9});
        settings.read_psd = true;
        make();
        static_cast<void>(begin());
    }
    bool asked() {
        while (shaker.psds_asked == 0 && drivers::to_seconds(now) < 200) run_rig();
        return shaker.psds_asked == 1;
    }
};

TEST_F(PsdDwellTest, WaitsAtRestUntilItIsReported) {
    ASSERT_TRUE(asked());
    EXPECT_TRUE(shaker.psd_asked_at_rest);
    run_for(5);
    EXPECT_EQ(status().state, CampaignState::resting);
    EXPECT_EQ(positions_done, 1) << "it is not in the journal before it is whole";
    shaker.psd_answer = {1, {{20, 0.01}, {120, 0.01}}, ""};
    played.summary.run = 2;
    played.summary.samples = 400;
    played.random.place = 1;
    ASSERT_TRUE(run_until(CampaignState::finished, 200)) << status().reason;
    EXPECT_EQ(shaker.psds_asked, 1U) << "of sines nobody asks";
    ASSERT_EQ(reported_psds.size(), 1U);
    EXPECT_EQ(reported_psds[0].pairs, shaker.psd_answer.pairs);
    EXPECT_EQ(positions_done, 3);
    ASSERT_TRUE(infos_done[1].played);
    EXPECT_EQ(infos_done[1].played->place, 1U);
    EXPECT_EQ(stops_done[1].psd, shaker.psd_answer.pairs);
    EXPECT_FALSE(infos_done[2].played);
}

TEST_F(PsdDwellTest, DoesNotWaitForever) {
    ASSERT_TRUE(asked());
    ASSERT_TRUE(run_until(CampaignState::finished, 200)) << status().reason;
    ASSERT_EQ(reported_psds.size(), 1U);
    EXPECT_EQ(reported_psds[0].why_not, "no answer within 15 s");
    EXPECT_EQ(positions_done, 3);
}

TEST_F(PsdDwellTest, ADwellThatFallsByItCountsAsRejected) {
    ASSERT_TRUE(asked());
    shaker.psd_answer = {1, {{20, 0.01}, {120, 0.01}}, ""};
    played.summary.run = 2;
    played.summary.position = 2;
    played.summary.samples = 400;
    played.summary.flagged = played.summary.left_out = true;
    played.summary.reason = "the PSD lies";
    run_for(1);
    EXPECT_THAT(events, testing::Contains("run 2 position 2: the PSD lies"));
    EXPECT_TRUE(status().dwells.back().left_out);
}

TEST_F(PsdDwellTest, ACampaignThatEndsDoesNotAsk) {
    ASSERT_TRUE(asked());
    campaign->on_trip("a test", now);
    ASSERT_EQ(reported_psds.size(), 1U);
    EXPECT_EQ(reported_psds[0].why_not, "the campaign ended before it was read");
    EXPECT_EQ(positions_done, 2);
    EXPECT_EQ(ends, 1);
}

}  // namespace
}  // namespace vibrig::campaign
