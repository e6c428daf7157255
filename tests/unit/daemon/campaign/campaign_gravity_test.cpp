// Before each ramp: gravity against the encoders, dwells that were rejected, samples that do not
// fit.
#include <algorithm>
#include <cmath>

#include "tests/unit/daemon/campaign/watched_campaign.hpp"

namespace vibrig::campaign {
namespace {

TEST_F(WatchedCampaign, ReportsWhatTheTableIsToDoWhenItIsCommanded) {
    settings.table_g = {9};
    settings.positions_deg = {{0, 0, 0}, {90, 0, 0}};
    make();
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::finished, 300));
    // up and down at each position, with what the accelerometers have of the vertical there
    ASSERT_EQ(ramps.size(), 4U);
    for (std::size_t i = 0; i < 4; ++i) {
        EXPECT_EQ(ramps[i].start_g, i % 2 == 0 ? 0 : 9);
        EXPECT_EQ(ramps[i].target_g, i % 2 == 0 ? 9 : 0);
        EXPECT_EQ(ramps[i].armed_g, 9);
        EXPECT_EQ(ramps[i].duration, drivers::from_seconds(settings.ramp_s));
        EXPECT_NEAR(std::abs(ramps[i].raw_up[i < 2 ? 1 : 2]), 1, 1e-12);
    }
}

TEST_F(WatchedCampaign, GravityIsLookedAtBeforeEveryRampAndARightRigGoesThrough) {
    settings.positions_deg = {{0, 0, 0}, {60, 15, 90}, {-100, 20, 30}};
    watched = true;
    make();
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::finished, 600)) << status().reason;
    for (const auto& event : events) EXPECT_EQ(event.find("gravity"), std::string::npos) << event;
}

TEST_F(WatchedCampaign, NothingIsRampedWhereGravityIsNotWhereTheEncodersSay) {
    // GIVEN the wrong sign of the inner encoder, which the first position does not show
    settings.positions_deg = {{0, 0, 0}, {60, 15, 90}};
    settings.table_g = {9};
    settings.rig.encoder_sign = {1, -1, 1};
    watched = true;
    make();
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    // WHEN it comes to the second position THEN it pauses at rest and names the key
    ASSERT_TRUE(run_until(CampaignState::paused, 300));
    EXPECT_EQ(ramps.size(), 2U) << "of the first position alone";
    EXPECT_TRUE(shaker.now.at_rest());
    EXPECT_NE(status().reason.find("deg off what the encoders say"), std::string::npos)
        << status().reason;
    EXPECT_NE(status().reason.find("encoder_sign of the inner gimbal"), std::string::npos)
        << status().reason;
    // WHEN it is resumed as it is THEN it comes to the same
    ASSERT_TRUE(command(Kind::resume).accepted);
    run_for(1);
    ASSERT_TRUE(run_until(CampaignState::paused, 60));
    EXPECT_EQ(ramps.size(), 2U);
    // and put right, it goes on
    truth.encoder_sign = settings.rig.encoder_sign;
    ASSERT_TRUE(command(Kind::resume).accepted);
    EXPECT_TRUE(run_until(CampaignState::finished, 300)) << status().reason;
}

TEST_F(WatchedCampaign, AVibrationThatIsNotVerticalIsReportedAndPausesAfterItsDwell) {
    watched = true;
    make();
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::recording, 100));
    EXPECT_TRUE(events.empty() || events.back().find("off the vertical") == std::string::npos);
    // WHEN a third of the vibration goes across in one second THEN there is no warning
    across = 1.0 / 3;
    run_for(1);
    across = 0;
    run_for(2);
    const auto warned = [this] {
        return std::ranges::count_if(events, [](const std::string& event) {
            return event.find("is 18.4 deg off the vertical") == event.npos
                       ? false
                       : event.starts_with("the vibration of");
        });
    };
    EXPECT_EQ(warned(), 0);
    // WHEN it stays THEN there is a warning within three seconds
    across = 1.0 / 3;
    run_for(3);
    EXPECT_EQ(warned(), 1);
    // and the campaign pauses at rest when the dwell is over
    ASSERT_TRUE(run_until(CampaignState::paused, 300)) << status().reason;
    EXPECT_EQ(orders.size(), 1U);
    EXPECT_TRUE(shaker.now.at_rest());
    EXPECT_NE(status().reason.find("18.4 deg off the vertical"), std::string::npos)
        << status().reason;
    // put right, it goes on
    across = 0;
    ASSERT_TRUE(command(Kind::resume).accepted);
    EXPECT_TRUE(run_until(CampaignState::finished, 300)) << status().reason;
    EXPECT_EQ(warned(), 1);
}

TEST_F(WatchedCampaign, AMeanForceThatIsNotOneGIsNotRampedUpon) {
    watched = true;
    gravity = 1.03;
    make();
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::paused, 100));
    EXPECT_NE(status().reason.find("1.030 g"), std::string::npos) << status().reason;
    EXPECT_TRUE(ramps.empty());
}

TEST_F(WatchedCampaign, TwoRejectedDwellsInARowPauseAtRestWithTheCause) {
    all_rejected = true;
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::paused, 300));
    EXPECT_EQ(orders.size(), 2U);
    EXPECT_TRUE(shaker.now.at_rest());
    EXPECT_NE(status().reason.find("2 dwells in a row rejected, the last: mean force"),
              std::string::npos)
        << status().reason;
    // somebody who takes that upon himself goes on; the state stays finished
    ASSERT_TRUE(command(Kind::resume).accepted);
    EXPECT_TRUE(run_until(CampaignState::finished, 300));
    EXPECT_EQ(orders.size(), 4U);
}

TEST_F(WatchedCampaign, DwellsThatAreNotValidTogetherPauseWhereThatIsAskedFor) {
    settings.on_not_valid = OnNotValid::pause;
    make();
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::recording, 100));
    campaign->doubted("after 12 dwells not valid: azimuth");
    ASSERT_TRUE(run_until(CampaignState::paused, 300)) << status().reason;
    EXPECT_EQ(orders.size(), 1U) << "the dwell under way is closed";
    EXPECT_TRUE(shaker.now.at_rest());
    EXPECT_NE(status().reason.find("not valid: azimuth"), std::string::npos) << status().reason;
    // somebody who takes that upon himself goes on, and is not asked for the same again
    ASSERT_TRUE(command(Kind::resume).accepted);
    EXPECT_TRUE(run_until(CampaignState::finished, 300)) << status().reason;
    EXPECT_EQ(orders.size(), 4U);
}

TEST_F(WatchedCampaign, DwellsThatAreNotValidTogetherDoNotHoldItUpByThemselves) {
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::recording, 100));
    campaign->doubted("after 12 dwells not valid: azimuth");
    ASSERT_TRUE(run_until(CampaignState::finished, 300)) << status().reason;
}

TEST_F(WatchedCampaign, DwellsThatAreFlaggedButUsedDoNotPause) {
    // Another noise than in the earlier dwells, samples left out: the estimate takes them.
    all_flagged = true;
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::finished, 300)) << status().reason;
    EXPECT_EQ(orders.size(), 4U);
}

TEST_F(WatchedCampaign, WhatIsNotMeasuredRightIsNotArmedOn) {
    unfit = "80.0 samples/s measured, can.sample_rate_hz = 40";
    const auto reply = command(Kind::arm);
    EXPECT_FALSE(reply.accepted);
    EXPECT_EQ(reply.message, unfit);
    unfit.clear();
    EXPECT_TRUE(command(Kind::arm).accepted);
}

}  // namespace
}  // namespace vibrig::campaign
