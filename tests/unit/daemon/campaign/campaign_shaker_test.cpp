// What becomes of a stop.
#include "tests/unit/daemon/campaign/campaign_fixture.hpp"

namespace vibrig::campaign {
namespace {

TEST_F(CampaignTest, IsNotDoneWhileTheTableMovesWhateverTheControllerSays) {
    // GIVEN a table that shakes on when its controller reads run 0 and 0 g
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::recording, 60));
    accelerometers.table_g = 4.7;
    // WHEN it is aborted and the daemon is to end
    EXPECT_TRUE(command(Kind::abort).accepted);
    EXPECT_TRUE(campaign->stopping()) << "nobody feeds the watchdog from here on";
    campaign->shut_down(now);
    run_for(2.9);
    EXPECT_TRUE(shaker.now.at_rest());
    EXPECT_FALSE(campaign->done(now));
    EXPECT_FALSE(disobeyed);
    run_for(0.4);
    // THEN the stop is reported as not obeyed after 3 s, and never as confirmed
    EXPECT_TRUE(disobeyed);
    EXPECT_THAT(events, testing::Contains(testing::AllOf(
                            testing::HasSubstr("stop not obeyed"), testing::HasSubstr("Ada"),
                            testing::HasSubstr("table 3."),
                            testing::HasSubstr("press the emergency stop"))));
    run_for(20);
    EXPECT_FALSE(campaign->done(now));
    EXPECT_THAT(events, testing::Not(testing::Contains(testing::HasSubstr("stop confirmed"))));
    // WHEN somebody presses the emergency stop THEN it is over
    accelerometers.table_g = 0;
    run_for(1);
    EXPECT_TRUE(campaign->done(now));
}

TEST_F(CampaignTest, AStopThatWasNotObeyedIsAcknowledgedAtRestOnly) {
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::recording, 60));
    accelerometers.table_g = 5;
    campaign->on_trip("tilt", now);
    run_for(4);
    ASSERT_TRUE(disobeyed);
    EXPECT_THAT(status().reason, testing::AllOf(testing::StartsWith("tilt; stop not obeyed"),
                                                testing::HasSubstr("press the emergency stop")));
    const auto refused = command(Kind::acknowledge);
    EXPECT_FALSE(refused.accepted);
    EXPECT_THAT(refused.message, testing::HasSubstr("not at rest yet"));
    EXPECT_EQ(status().state, CampaignState::tripped);
    accelerometers.table_g = 0;
    run_for(1);
    EXPECT_THAT(events.back(), testing::StartsWith("stop confirmed: rest measured"));
    EXPECT_TRUE(command(Kind::acknowledge).accepted);
    EXPECT_TRUE(command(Kind::arm).accepted);
}

TEST_F(CampaignTest, APlannedRampDownThatDoesNotEndIsAStop) {
    // GIVEN a table that never comes to rest after the dwell
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::recording, 60));
    accelerometers.table_g = 9;
    ASSERT_TRUE(run_until(CampaignState::resting, 60));
    // THEN it is waited for, and the watchdog fed, for ramp_s + stop_deadline_s and not longer
    const Time began = now;
    ASSERT_TRUE(run_until(CampaignState::aborted, 60));
    EXPECT_NEAR(drivers::to_seconds(now - began), settings.ramp_s + 3, 0.25);
    EXPECT_TRUE(campaign->stopping());
    run_for(3.4);
    EXPECT_TRUE(disobeyed);
}

TEST_F(CampaignTest, ArmsOnlyWithAWatchdogTimeoutThatIsAsWritten) {
    shaker.now.watchdog = drivers::WatchdogTimeout::changed;
    shaker.now.watchdog_timeout_s = 60;
    EXPECT_THAT(command(Kind::arm).message, testing::HasSubstr("watchdog timeout reads 60 s"));
    // WHEN it is acknowledged THEN a stop goes out, after which the timeout is written again
    EXPECT_EQ(command(Kind::acknowledge).message, "acknowledged: watchdog timeout of 60 s");
    EXPECT_EQ(shaker.stops_asked, 1U);
    shaker.now.watchdog = drivers::WatchdogTimeout::unread;
    run_for(1);
    EXPECT_FALSE(command(Kind::arm).accepted);
    shaker.now.watchdog = drivers::WatchdogTimeout::kept;
    EXPECT_TRUE(command(Kind::arm).accepted);
}

/// Nothing is written to a controller that nobody knows yet, and it may say so.
TEST_F(CampaignTest, WhileItIsCommissionedTheShakersLinkIsReadOnly) {
    run_for(1);
    ASSERT_EQ(campaign->begin_commissioning("Ada", now), "");
    EXPECT_TRUE(shaker.only_read);
    shaker_obeys = false;
    shaker.now.state = drivers::kShakerFault;  // its watchdog counts at rest, too
    shaker.now.fault = 1;
    run_for(5);
    EXPECT_TRUE(campaign->commissioning());
    EXPECT_TRUE(shaker.requests.empty());
    EXPECT_EQ(shaker.stops(), 0U);
    shaker.now.state = drivers::kShakerRunning;
    run_for(1);
    EXPECT_FALSE(campaign->commissioning()) << "what runs is stopped, whoever may write";
    EXPECT_EQ(shaker.stops(), 1U);
    EXPECT_FALSE(shaker.only_read);
}

}  // namespace
}  // namespace vibrig::campaign
