// What becomes of a stop.
#include <numbers>

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

TEST_F(CampaignTest, IsNotAcknowledgedWhileAStopIsUnderWayAndTheTableMoves) {
    // GIVEN a trip, and a contactor that is welded
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::recording, 60));
    accelerometers.table_g = 5;
    campaign->on_trip("loop open", now);
    run_for(0.7);
    ASSERT_FALSE(disobeyed) << "it still has its time";
    // WHEN somebody is quick THEN that is refused with what moves
    EXPECT_THAT(
        command(Kind::acknowledge).message,
        testing::AllOf(testing::StartsWith("a stop is under way, rest is not measured yet: "),
                       testing::HasSubstr("table 3."), testing::HasSubstr("platform 1.")));
    // AND so it is where nobody can tell
    accelerometers.silent = true;
    run_for(0.5);
    EXPECT_THAT(command(Kind::acknowledge).message,
                testing::HasSubstr("no good accelerometer on the table"));
    EXPECT_EQ(status().state, CampaignState::tripped);
    accelerometers.silent = false;
    accelerometers.table_g = 0;
    run_for(1.5);
    EXPECT_THAT(events, testing::Contains(testing::StartsWith("stop confirmed")));
    EXPECT_TRUE(command(Kind::acknowledge).accepted);
}

/// Without an accelerometer on the table the platform's has to tell.
TEST_F(CampaignTest, ATableThatStartsByItselfDuringASlewIsUncommanded) {
    accelerometers.table_bound = false;
    starts_by_itself = true;
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::slewing, 60));
    run_for(0.3);
    accelerometers.table_g = 4.9;
    const Time began = now;
    for (int i = 0; i < 20 && uncommanded == 0; ++i) run_rig();
    EXPECT_EQ(uncommanded, 1);
    EXPECT_EQ(status().state, CampaignState::slewing);
    EXPECT_LE(drivers::to_seconds(now - began), 1.5);
    EXPECT_THAT(events.back(), testing::StartsWith("motion without a command: platform 1."));
}

TEST_F(CampaignTest, ATableThatStartsByItselfDuringAPauseIsUncommanded) {
    accelerometers.table_bound = false;
    starts_by_itself = true;
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::recording, 60));
    ASSERT_TRUE(command(Kind::pause).accepted);
    ASSERT_TRUE(run_until(CampaignState::paused, 60));
    // GIVEN a hand on the platform
    accelerometers.platform_g = 0.045 * std::numbers::sqrt2;
    run_for(600);
    EXPECT_EQ(uncommanded, 0);
    // WHEN the table moves by a tenth of a g
    accelerometers.platform_g.reset();
    accelerometers.table_g = 0.15;
    const Time began = now;
    for (int i = 0; i < 20 && uncommanded == 0; ++i) run_rig();
    EXPECT_EQ(uncommanded, 1);
    EXPECT_LE(drivers::to_seconds(now - began), 1.5);
}

TEST_F(CampaignTest, NothingIsUncommandedInACampaignWithoutAWitnessOnTheTable) {
    // GIVEN slews that shake the platform, as no gimbal does
    accelerometers.table_bound = false;
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    for (int i = 0; i < 4000 && status().state != CampaignState::finished; ++i) {
        const bool slews = status().state == CampaignState::slewing && platform.slewing;
        accelerometers.platform_g.reset();
        if (slews) accelerometers.platform_g = 0.15 * std::numbers::sqrt2;
        run_rig();
    }
    EXPECT_EQ(status().state, CampaignState::finished) << status().reason;
    EXPECT_EQ(uncommanded, 0);
}

/// In a dwell at level.
struct ShakingTest : CampaignTest {
    void begin() {
        ASSERT_TRUE(command(Kind::arm).accepted);
        ASSERT_TRUE(command(Kind::start).accepted);
        ASSERT_TRUE(run_until(CampaignState::recording, 60));
        run_for(1);
    }
};

TEST_F(ShakingTest, SomebodyElsesGimbalCommandIsATrip) {
    begin();
    // GIVEN one status that is out of order
    const auto ours = platform.gimbal_command_echo;
    platform.gimbal_command_echo = 77;
    run_for(0.2);
    platform.gimbal_command_echo = ours;
    run_for(1);
    EXPECT_EQ(gimbals_led, 0);
    // WHEN the platform takes another's command
    platform.gimbal_command_echo = 77;
    platform.slewing = true;
    const Time began = now;
    for (int i = 0; i < 20 && gimbals_led == 0; ++i) run_rig();
    EXPECT_EQ(gimbals_led, 1);
    EXPECT_LE(drivers::to_seconds(now - began), 0.5);
    EXPECT_THAT(events, testing::Contains(testing::AllOf(testing::HasSubstr("not left alone"),
                                                         testing::HasSubstr("command 77"))));
    EXPECT_TRUE(campaign->stopping());
    run_for(5);
    EXPECT_EQ(gimbals_led, 1) << "said once";
}

TEST_F(ShakingTest, APlatformThatSlewsByItselfIsATrip) {
    begin();
    platform.slewing = true;
    run_for(0.6);
    EXPECT_EQ(gimbals_led, 1);
}

TEST_F(ShakingTest, AGimbalStatusThatDoesNotComeIsStale) {
    begin();
    gimbal_status = false;
    const Time began = now;
    for (int i = 0; i < 20 && gimbals_silent == 0; ++i) run_rig();
    EXPECT_EQ(gimbals_silent, 1);
    EXPECT_NEAR(drivers::to_seconds(now - began), 0.5, 0.15);
    EXPECT_THAT(events, testing::Contains(testing::StartsWith("no gimbal status for 0.")));
}

TEST_F(ShakingTest, AtRestTheGimbalsAreTheOperators) {
    begin();
    ASSERT_TRUE(command(Kind::pause).accepted);
    ASSERT_TRUE(run_until(CampaignState::paused, 60));
    platform.gimbal_command_echo = 77;
    platform.slewing = true;
    run_for(5);
    platform.slewing = false;
    ASSERT_TRUE(command(Kind::resume).accepted);
    EXPECT_TRUE(run_until(CampaignState::finished, 300)) << status().reason;
    EXPECT_EQ(gimbals_led + gimbals_silent, 0);
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

TEST_F(CampaignTest, AfterAStandstillAtRestTheShakerIsReadOnceMore) {
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    run_rig();
    for (const CampaignState state : {CampaignState::waiting, CampaignState::slewing}) {
        ASSERT_TRUE(status().state == state || run_until(state, 60));
        // WHEN neither this nor the shaker's thread has run for 3 s
        now += 3 * kSecond;
        shaker.now.valid = false;
        campaign->step(now);
        EXPECT_EQ(status().state, state);
        // and the shaker is read a second after that
        for (int i = 0; i < 10; ++i) campaign->step(now += 100 * kMillisecond);
        EXPECT_EQ(status().state, state);
        EXPECT_TRUE(shaker.requests.empty()) << "nothing is asked of what is not known";
        shaker.now.valid = true;
    }
    // THEN it goes on to its end
    EXPECT_TRUE(run_until(CampaignState::finished, 200)) << testing::PrintToString(events);
}

TEST_F(CampaignTest, AStandstillExcusesNoShakerThatIsSilentAfterIt) {
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::slewing, 60));
    now += 3 * kSecond;
    shaker.now.valid = false;
    for (int i = 0; i < 20; ++i, now += 100 * kMillisecond) campaign->step(now);
    EXPECT_EQ(status().state, CampaignState::slewing);
    campaign->step(now);
    EXPECT_EQ(status().state, CampaignState::aborted);
    EXPECT_GE(shaker.stops_asked, 1U);
}

TEST_F(CampaignTest, ALongStandstillEndsItAtRestToo) {
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::slewing, 60));
    now += 11 * kSecond;
    shaker.now.valid = false;
    campaign->step(now);
    EXPECT_EQ(status().state, CampaignState::aborted);
}

TEST_F(CampaignTest, AStandstillWhileItShakesEndsIt) {
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::recording, 60));
    now += 3 * kSecond;
    shaker.now.valid = false;
    campaign->step(now);
    EXPECT_EQ(status().state, CampaignState::aborted);
    EXPECT_GE(shaker.stops_asked, 1U);
}

TEST_F(CampaignTest, StandstillsOneAfterTheOtherNeitherHoldItUpNorExcuseASilentShaker) {
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(status().state == CampaignState::waiting || run_until(CampaignState::waiting, 60));
    for (int i = 0; i < 200 && status().state == CampaignState::waiting; ++i) {
        now += 700 * kMillisecond;
        run_rig();  // 100 ms more
    }
    EXPECT_EQ(status().state, CampaignState::slewing) << testing::PrintToString(events);
    shaker.now.valid = false;
    // THEN 2 s are left to it, not 2 s after each of them
    for (int i = 0; i < 3; ++i) campaign->step(now += 800 * kMillisecond);
    EXPECT_EQ(status().state, CampaignState::aborted);
}

TEST_F(CampaignTest, AShakerThatIsSilentWithoutAStandstillEndsItAtRestToo) {
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::slewing, 60));
    run_rig();
    shaker.now.valid = false;
    campaign->step(now);
    EXPECT_EQ(status().state, CampaignState::aborted);
}

}  // namespace
}  // namespace vibrig::campaign
