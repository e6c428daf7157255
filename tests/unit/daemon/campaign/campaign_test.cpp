#include "tests/unit/daemon/campaign/campaign_fixture.hpp"

namespace vibrig::campaign {
namespace {

TEST_F(CampaignTest, NothingMovesBeforeANamedPersonArmsAndStarts) {
    // WHEN time passes, or somebody starts without arming, or nameless
    run_for(30);
    EXPECT_FALSE(command(Kind::start).accepted);
    EXPECT_FALSE(campaign->command({Kind::arm, "", ""}, now).accepted);
    run_for(30);
    // THEN neither the shaker nor the gimbals got a command
    EXPECT_TRUE(shaker.requests.empty());
    EXPECT_TRUE(port.frames.empty());
}

TEST_F(CampaignTest, VisitsEveryPositionOfEveryRunAndSlewsOnlyAtRest) {
    // WHEN armed and started
    ASSERT_TRUE(command(Kind::arm).accepted);
    EXPECT_EQ(status().armed_by, "Ada");
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::finished, 300));
    // THEN all dwells were ordered in turn, as long as configured, and announced ahead
    ASSERT_EQ(orders.size(), 4U);
    for (std::size_t i = 0; i < 4; ++i) {
        EXPECT_EQ(orders[i].dwell.run, static_cast<int>(i / 2) + 1);
        EXPECT_EQ(orders[i].dwell.position, static_cast<int>(i % 2) + 1);
        EXPECT_EQ(orders[i].dwell.table_g, settings.table_g[i / 2]);
        EXPECT_EQ(orders[i].to - orders[i].from, 10 * kSecond);
    }
    EXPECT_FALSE(slewed_while_moving);
    EXPECT_TRUE(complete);
    EXPECT_EQ(ends, 1);
    // AND the shaker is at rest, unwatched and disarmed
    EXPECT_TRUE(shaker.now.at_rest());
    EXPECT_EQ(guard, rt::Guard::idle);
    EXPECT_EQ(status().armed_by, "");
    EXPECT_EQ(status().progress, 1.0);
    EXPECT_FALSE(command(Kind::start).accepted) << "one arming covers one campaign";
}

TEST_F(CampaignTest, WaitsForAReadyPlatformAndASteadyTemperature) {
    // GIVEN a platform that warms by 0.2 deg C a second and is not ready at first
    platform.ready = false;
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    for (int i = 0; i < 400; ++i) {
        if (i == 200) {
            EXPECT_EQ(status().state, CampaignState::waiting);
            EXPECT_EQ(status().reason, "platform not ready");
            platform.ready = true;
        }
        platform.temperature_c += 0.02;
        run_rig();
    }
    EXPECT_EQ(status().reason, "temperature not steady");
    EXPECT_TRUE(port.frames.empty());
    // WHEN it is steady for the window, THEN the campaign begins
    EXPECT_TRUE(run_until(CampaignState::slewing, 20));
}

TEST_F(CampaignTest, ATemperatureThatNoLongerComesIsNotSteady) {
    // GIVEN a platform whose thermometer has a message of its own, which has ceased
    run_rig();
    temperature_comes = false;
    for (int i = 0; i < 601; ++i) run_rig();
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    for (int i = 0; i < 100; ++i) run_rig();
    EXPECT_EQ(status().state, CampaignState::waiting);
    EXPECT_EQ(status().reason, "no temperature on the bus");
    // WHEN it comes again THEN its window is waited for
    temperature_comes = true;
    for (int i = 0; i < 40; ++i) run_rig();
    EXPECT_EQ(status().reason, "temperature not steady");
    EXPECT_TRUE(run_until(CampaignState::slewing, 20));
}

TEST_F(CampaignTest, WaitsForTheFirstPlatformStatus) {
    // GIVEN a campaign started before the platform has said anything
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    platform.time = 0;
    // WHEN the campaign looks at it, THEN it waits and says for what
    for (int i = 0; i < 3; ++i) campaign->step(now += 100 * kMillisecond);
    EXPECT_EQ(status().state, CampaignState::waiting);
    EXPECT_EQ(status().reason,
              "no platform status on the bus: loop and fault have to come each second, changed or "
              "not");
    // and goes on when the platform speaks
    EXPECT_TRUE(run_until(CampaignState::slewing, 30));
}

TEST_F(CampaignTest, GivesUpWaitingAfterTheTimeLimit) {
    platform.loop_closed = false;
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    EXPECT_TRUE(run_until(CampaignState::aborted, settings.ready_timeout_s + 5));
    EXPECT_EQ(status().reason, "stabilisation loop open after 600 s");
}

TEST_F(CampaignTest, AnAbortStopsTheShakerAndEndsTheArming) {
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::recording, 60));
    EXPECT_EQ(guard, rt::Guard::excitation);
    EXPECT_TRUE(command(Kind::abort).accepted);
    EXPECT_GE(shaker.stops_asked, 1U);
    EXPECT_TRUE(orders.back().cancel);
    EXPECT_EQ(status().state, CampaignState::aborted);
    const auto requests = shaker.requests.size();
    run_for(30);
    // the fake rig appends the one stop; no set-point follows it
    EXPECT_EQ(shaker.requests.size(), requests + 1);
    EXPECT_FALSE(command(Kind::start).accepted);
    EXPECT_EQ(ends, 1);
    EXPECT_FALSE(complete);
}

// The server's thread stops at once and then says so: the table falls before its word is here.
TEST_F(CampaignTest, TheReasonOfAnAbortIsWhoOrderedIt) {
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::recording, 60));
    shaker.stop_now();
    run_for(0.5);
    EXPECT_EQ(status().state, CampaignState::recording);
    EXPECT_TRUE(command(Kind::abort).accepted);
    EXPECT_TRUE(status().reason.starts_with("aborted by ")) << status().reason;
}

TEST_F(CampaignTest, AStopOfWhichNobodySpeaksEndsTheCampaign) {
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::recording, 60));
    shaker.stop_now();
    EXPECT_TRUE(run_until(CampaignState::aborted, 3));
    EXPECT_TRUE(status().reason.starts_with("shaker off command")) << status().reason;
}

TEST_F(CampaignTest, ATripLatchesUntilAcknowledged) {
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::recording, 60));
    shaker.stop_now();  // the interlock does that itself
    campaign->on_trip("emergency-stop chain open", now);
    run_for(60);
    EXPECT_EQ(status().state, CampaignState::tripped);
    EXPECT_FALSE(command(Kind::arm).accepted);
    EXPECT_TRUE(command(Kind::acknowledge).accepted);
    EXPECT_EQ(status().state, CampaignState::idle);
    EXPECT_TRUE(command(Kind::arm).accepted);
}

TEST_F(CampaignTest, AStopOfSomebodyElsesIsNotUndoneByTheNextLevel) {
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::recording, 60));
    ASSERT_TRUE(run_until(CampaignState::slewing, 200));
    // GIVEN the interlock's stop, confirmed before this thread hears of it
    shaker.stop_now();
    shaker.obey(now);
    const auto requests = shaker.requests.size();
    // THEN the next level is not asked for
    ASSERT_TRUE(run_until(CampaignState::aborted, 200));
    EXPECT_EQ(status().reason, "the shaker takes no set-point");
    run_for(30);
    for (auto i = requests; i < shaker.requests.size(); ++i)
        EXPECT_EQ(shaker.requests[i].amplitude_g, 0);
}

TEST_F(CampaignTest, AFaultThatTheControllerLatchedMeanwhileIsAcknowledgedByAStop) {
    EXPECT_FALSE(command(Kind::acknowledge).accepted);
    shaker.now.fault = 1;
    shaker.now.measured_g = 2;
    EXPECT_FALSE(command(Kind::arm).accepted);
    EXPECT_FALSE(command(Kind::acknowledge).accepted);
    shaker.now.measured_g = 0;
    EXPECT_TRUE(command(Kind::acknowledge).accepted);
    EXPECT_EQ(shaker.stops_asked, 1U);
    EXPECT_EQ(status().state, CampaignState::idle);
}

TEST_F(CampaignTest, OneAcknowledgementIsForTheTripAndForWhatTheControllerLatched) {
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::recording, 60));
    // GIVEN an emergency stop, which the controller latches as a fault of its own
    shaker.stop_now();
    campaign->on_trip("emergency-stop chain open", now);
    shaker.obey(now);
    shaker.now.fault = 2;
    shaker.now.emergency_stop_open = true;
    const auto refused = command(Kind::acknowledge);
    EXPECT_FALSE(refused.accepted);
    EXPECT_EQ(refused.message, "the emergency-stop chain is open: close it first");
    shaker.now.emergency_stop_open = false;
    shaker.now.measured_g = 2;
    EXPECT_EQ(command(Kind::acknowledge).message, "the table is not at rest yet");
    EXPECT_EQ(status().state, CampaignState::tripped) << "what was refused has changed nothing";
    // WHEN the chain is closed and the table at rest THEN once is enough
    shaker.now.measured_g = 0;
    EXPECT_THAT(command(Kind::acknowledge).message,
                testing::StartsWith("a stop is under way, rest is not measured yet"))
        << "whatever the controller says";
    shaker_obeys = false;  // it has, and its fault stays
    run_for(1);
    const auto stops = shaker.stops_asked.load();
    EXPECT_EQ(command(Kind::acknowledge).message,
              "acknowledged: emergency-stop chain open; shaker fault 0x0002");
    EXPECT_EQ(shaker.stops_asked, stops + 1);
    EXPECT_EQ(command(Kind::arm).message, "a stop of the shaker is pending");
    shaker_obeys = true;
    run_rig();
    shaker.now.fault = 0;
    EXPECT_THAT(command(Kind::arm).message, testing::StartsWith("stopping: rest is not measured"));
    run_for(1);
    EXPECT_TRUE(command(Kind::arm).accepted);
}

TEST_F(CampaignTest, AnAcknowledgementOfATripNeedsNoShaker) {
    shaker.now.fault = 2;
    shaker.now.valid = false;
    EXPECT_FALSE(command(Kind::acknowledge).accepted) << "an old reading says nothing";
    campaign->on_trip("CAN bus lost", now);
    EXPECT_TRUE(command(Kind::acknowledge).accepted);
    EXPECT_EQ(status().state, CampaignState::idle);
}

TEST_F(CampaignTest, ALoopCheckOutOfBandInAnEarlierLifeKeepsTheShakerDisarmed) {
    campaign->take_over_loop_check("distortion 0.3, expected 0 to 0.05");
    const auto refused = command(Kind::arm);
    EXPECT_FALSE(refused.accepted);
    EXPECT_EQ(refused.message,
              "the loop check was out of band: distortion 0.3, expected 0 to 0.05");
}

TEST_F(CampaignTest, StopsWhenTheMeasuredAmplitudeLeavesTheCommand) {
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::recording, 60));
    shaker.now.measured_g = 9 * 1.06;
    campaign->step(now);
    EXPECT_EQ(status().state, CampaignState::aborted);
    EXPECT_GE(shaker.stops_asked, 1U);
}

TEST_F(CampaignTest, StopsWhenTheShakerNoLongerAnswers) {
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::recording, 60));
    shaker.now.valid = false;
    campaign->step(now);
    EXPECT_EQ(status().state, CampaignState::aborted);
    EXPECT_GE(shaker.stops_asked, 1U);
}

TEST_F(CampaignTest, PausesAtRestBeforeTheNextPositionAndResumes) {
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::recording, 60));
    ASSERT_TRUE(command(Kind::pause).accepted);
    ASSERT_TRUE(run_until(CampaignState::paused, 60));
    EXPECT_TRUE(shaker.now.at_rest());
    run_for(30);
    EXPECT_EQ(orders.size(), 1U);
    ASSERT_TRUE(command(Kind::resume).accepted);
    EXPECT_TRUE(run_until(CampaignState::finished, 200));
    EXPECT_EQ(orders.size(), 4U);
}

TEST_F(CampaignTest, ShutsDownByRampingToRestFirst) {
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::recording, 60));
    campaign->shut_down(now);
    EXPECT_FALSE(campaign->done(now));
    ASSERT_TRUE(run_until(CampaignState::aborted, 20));
    EXPECT_TRUE(campaign->done(now));
    EXPECT_TRUE(shaker.now.at_rest());
    EXPECT_EQ(shaker.stops_asked, 0U) << "ramped down, not cut";
    EXPECT_FALSE(command(Kind::arm).accepted);
}

TEST_F(CampaignTest, RunsThePlanFilesStopsInTheirOrder) {
    // GIVEN a plan that changes the level from stop to stop
    settings.stops = {{{0, 0, 0}, 9}, {{0, 0, 90}, 0}, {{90, 0, 0}, 9}};
    make();
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::finished, 300));
    // THEN the dwells are those, a level is a run, and slews wait for rest
    ASSERT_EQ(orders.size(), 3U);
    const std::array<int, 3> runs{1, 2, 1};
    for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_EQ(orders[i].dwell.table_g, settings.stops[i].table_g);
        EXPECT_EQ(orders[i].dwell.run, runs[i]);
        EXPECT_EQ(orders[i].dwell.position, static_cast<int>(i) + 1);
    }
    EXPECT_FALSE(slewed_while_moving);
    EXPECT_EQ(status().progress, 1.0);
}

TEST_F(CampaignTest, AnAdaptiveCampaignRepeatsFlaggedDwellsAndEndsWhenAskedTo) {
    // GIVEN two dwells to be chosen, of which the first is flagged
    settings.adaptive = true;
    stops_to_choose = {{{0, 0, 45}, 9}, {{0, 0, 90}, 0}};
    flagged_order = 1;
    make();
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::finished, 300));
    // THEN the flagged one is done again before the next choice
    ASSERT_EQ(orders.size(), 3U);
    EXPECT_EQ(orders[1].dwell.table_g, 9);
    EXPECT_EQ(orders[2].dwell.table_g, 0);
    ASSERT_EQ(asked_from.size(), 3U) << "the last answer was to end";
    EXPECT_EQ(asked_from[1], stops_to_choose[0].position_deg);
    EXPECT_TRUE(complete);
    EXPECT_NE(std::ranges::find(events, "every target is met"), events.end());
    EXPECT_NE(std::ranges::find(events, "flagged dwell: the position is repeated"), events.end());
}

TEST_F(CampaignTest, AFlaggedDwellIsNotRepeatedBeyondTheTimeLimit) {
    // GIVEN a flagged dwell after which there is no time for another
    settings.adaptive = true;
    settings.time_limit_s = 1.5 * settings.dwell_s;
    stops_to_choose = {{{0, 0, 45}, 9}};
    flagged_order = 1;
    make();
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::finished, 300));
    // THEN it is not repeated, and nothing is left to do
    EXPECT_EQ(orders.size(), 1U);
    EXPECT_EQ(status().progress, 1.0);
    EXPECT_EQ(std::ranges::find(events, "flagged dwell: the position is repeated"), events.end());
}

TEST_F(CampaignTest, AnAdaptiveCampaignWaitsAtRestWhileItsPlanIsThoughtOver) {
    settings.adaptive = true;
    stops_to_choose = {{{0, 0, 45}, 9}};
    thinking_steps = 50;
    make();
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    // WHEN it is thought over THEN the control thread goes on, and nothing moves
    ASSERT_TRUE(run_until(CampaignState::resting, 20));
    for (int i = 0; i < 20; ++i) {
        run_rig();
        EXPECT_EQ(status().state, CampaignState::resting);
        EXPECT_TRUE(shaker.now.at_rest());
        EXPECT_TRUE(port.frames.empty());
    }
    // WHEN it is known THEN it is done
    ASSERT_TRUE(run_until(CampaignState::finished, 100));
    EXPECT_EQ(orders.size(), 1U);
    EXPECT_EQ(thinking_steps, 0);
}

TEST_F(CampaignTest, AnAdaptiveCampaignGoesOnAfterARestartWithItsRepeatsAndItsTime) {
    // GIVEN an adaptive campaign of which three dwells are done, the last two flagged
    settings.adaptive = true;
    stops_to_choose = {{{0, 0, 45}, 9}, {{0, 0, 90}, 0}};
    make();
    std::vector<estimator::DwellSummary> summaries(3);
    std::vector<StopDone> stops{
        {{0, 0, 30}, 9, 0, 100}, {{90, 0, 0}, 0, 0, 210}, {{90, 0, 0}, 0, 1, 320}};
    const std::array<int, 3> run{1, 2, 2};
    for (std::size_t i = 0; i < 3; ++i) {
        summaries[i].run = run[i];
        summaries[i].position = static_cast<int>(i) + 1;
        summaries[i].flagged = i > 0;
    }
    EXPECT_FALSE(campaign->offer(summaries)) << "what was chosen is not known";
    ASSERT_TRUE(campaign->offer(summaries, stops));
    EXPECT_EQ(status().resume_offer, "3 positions done");
    // WHEN it is resumed
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::resume).accepted);
    flagged_order = 1;
    ASSERT_TRUE(run_until(CampaignState::finished, 400));
    // THEN the flagged position is repeated once more, and only once: two repeats are the most
    ASSERT_EQ(orders.size(), 3U);
    ASSERT_EQ(stops_done.size(), 3U);
    EXPECT_EQ(stops_done[0].position_deg, stops[2].position_deg);
    EXPECT_EQ(stops_done[0].table_g, 0);
    EXPECT_EQ(stops_done[0].repeats, 2);
    EXPECT_EQ(orders[0].dwell.run, 2);
    EXPECT_EQ(orders[0].dwell.position, 4);
    // AND its time goes on from the 320 s of the life before
    ASSERT_EQ(elapsed.size(), 3U);
    EXPECT_GT(elapsed[0], 320);
    EXPECT_LT(elapsed[0], 400);
    EXPECT_GT(stops_done[0].used_s, 320);
    EXPECT_EQ(asked_from[0], stops[2].position_deg);
    EXPECT_EQ(stops_done[1].repeats, 0);
    EXPECT_EQ(status().dwells.size(), 6U);
    // AND a new campaign begins from nothing
    asked_from.clear();
    elapsed.clear();
    stops_to_choose.clear();
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::aborted, 60));
    EXPECT_LT(elapsed.at(0), 30);
    EXPECT_EQ(status().reason, "nothing to do");
}

/// Positions done, two of each run.
std::vector<estimator::DwellSummary> done(std::size_t count) {
    std::vector<estimator::DwellSummary> summaries(count);
    for (std::size_t i = 0; i < count; ++i) {
        summaries[i].run = static_cast<int>(i / 2) + 1;
        summaries[i].position = static_cast<int>(i % 2) + 1;
    }
    return summaries;
}

TEST_F(CampaignTest, GoesOnAfterARestartWhereItWasAndOnlyOnCommand) {
    // GIVEN three positions of four done before a restart
    estimator::DwellSummary foreign;
    foreign.run = 3;
    foreign.position = 1;
    EXPECT_FALSE(campaign->offer({foreign})) << "no such position";
    EXPECT_FALSE(campaign->offer({done(1)[0], done(1)[0]})) << "the same twice";
    EXPECT_TRUE(campaign->offer(done(3)));
    EXPECT_EQ(status().resume_offer, "3 of 4 positions done");
    // WHEN nobody does anything, or resumes without arming, THEN nothing moves
    run_for(30);
    EXPECT_FALSE(command(Kind::resume).accepted);
    run_for(30);
    EXPECT_TRUE(shaker.requests.empty());
    EXPECT_TRUE(port.frames.empty());
    // WHEN armed, THEN it says how long either way takes, and still nothing moves
    const auto armed = command(Kind::arm);
    ASSERT_TRUE(armed.accepted);
    EXPECT_THAT(armed.message, testing::HasSubstr(", resumed about "));
    run_for(30);
    EXPECT_TRUE(shaker.requests.empty());
    // WHEN the rig is not as it was, THEN it is refused
    gate = "no platform status";
    EXPECT_THAT(command(Kind::resume).message, testing::HasSubstr("no platform status"));
    EXPECT_EQ(status().state, CampaignState::armed);
    gate.clear();
    // WHEN resumed, THEN the last position is recorded, and no other
    ASSERT_TRUE(command(Kind::resume).accepted);
    ASSERT_TRUE(run_until(CampaignState::finished, 200));
    ASSERT_EQ(orders.size(), 1U);
    EXPECT_EQ(orders[0].dwell.run, 2);
    EXPECT_EQ(orders[0].dwell.position, 2);
    EXPECT_EQ(status().dwells.size(), 4U);
    EXPECT_TRUE(complete);
    EXPECT_EQ(positions_done, 1);
    EXPECT_EQ(status().resume_offer, "");
}

TEST_F(CampaignTest, GoesOnWithWhatIsLeftOfAnotherOrder) {
    // GIVEN a restart after the second position of run 2 and the first of run 1
    const auto all = done(4);
    ASSERT_TRUE(campaign->offer({all[3], all[0]}));
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::resume).accepted);
    // THEN the two others follow, in their order
    ASSERT_TRUE(run_until(CampaignState::finished, 300));
    ASSERT_EQ(orders.size(), 2U);
    EXPECT_EQ(orders[0].dwell.run, 1);
    EXPECT_EQ(orders[0].dwell.position, 2);
    EXPECT_EQ(orders[1].dwell.run, 2);
    EXPECT_EQ(orders[1].dwell.position, 1);
    // AND dwells know when they began, since the first of this life
    EXPECT_EQ(orders[0].dwell.begin_s, 0);
    EXPECT_NEAR(orders[1].dwell.begin_s, drivers::to_seconds(orders[1].from - orders[0].from),
                1e-9);
}

TEST_F(CampaignTest, TellsTheFirstDwellAfterThePowerOfTheGyrosWasLost) {
    for (const bool lost : {false, true}) {
        SCOPED_TRACE(lost);
        orders.clear();
        stops_done.clear();
        make();
        // GIVEN a restart after two of four dwells, and gyros that are found run down, or not
        ASSERT_TRUE(campaign->offer(done(2)));
        platform.gyros_at_speed = !lost;
        run_for(5);
        platform.gyros_at_speed = true;
        // WHEN it is resumed
        ASSERT_TRUE(command(Kind::arm).accepted);
        ASSERT_TRUE(command(Kind::resume).accepted);
        ASSERT_TRUE(run_until(CampaignState::finished, 300));
        // THEN the dwell that comes first is marked so, no other
        ASSERT_EQ(orders.size(), 2U);
        EXPECT_EQ(orders[0].dwell.power_lost, lost);
        EXPECT_FALSE(orders[1].dwell.power_lost);
    }
}

TEST_F(CampaignTest, TakesNoRunUpBeforeTheFirstDwellForAPowerLoss) {
    platform.gyros_at_speed = false;
    run_for(5);
    platform.gyros_at_speed = true;
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::finished, 400));
    ASSERT_FALSE(orders.empty());
    for (const auto& order : orders) EXPECT_FALSE(order.dwell.power_lost);
}

/// As the journal has kept them, with what they repeat.
std::vector<StopDone> stops_of(const Settings& settings,
                               const std::vector<estimator::DwellSummary>& dwells) {
    std::vector<StopDone> stops(dwells.size());
    for (std::size_t i = 0; i < dwells.size(); ++i) {
        stops[i].position_deg = settings.positions_deg.at(dwells[i].position == 1 ? 0 : 1);
        stops[i].table_g = settings.table_g.at(static_cast<std::size_t>(dwells[i].run) - 1);
    }
    return stops;
}

TEST_F(CampaignTest, GoesOnAfterARestartWithADwellThatWasRepeated) {
    // GIVEN a restart after three dwells, the third of which repeats the second
    auto dwells = done(3);
    dwells[2].run = 1;
    dwells[2].position = 5;
    EXPECT_FALSE(campaign->offer(dwells)) << "what it repeats is not known";
    ASSERT_TRUE(campaign->offer(dwells, stops_of(settings, dwells)));
    EXPECT_EQ(status().resume_offer, "3 of 5 positions done");
    // WHEN it is resumed
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::resume).accepted);
    ASSERT_TRUE(run_until(CampaignState::finished, 300));
    // THEN the two of run 2 are left
    ASSERT_EQ(orders.size(), 2U);
    for (const auto& order : orders) EXPECT_EQ(order.dwell.run, 2);
    EXPECT_EQ(status().dwells.size(), 5U);
    // AND what repeats no stop of this campaign is refused
    auto stops = stops_of(settings, dwells);
    stops[2].table_g = 3;
    EXPECT_FALSE(campaign->offer(dwells, stops));
}

TEST_F(CampaignTest, TiesBothSidesOfALongInterruptionTogetherByADwellOfBefore) {
    const auto dwells = done(2);
    auto stops = stops_of(settings, dwells);
    stops[1].begun_utc_ns = 1'700'000'000 * drivers::kSecond;
    for (const int minutes : {50, 70}) {
        SCOPED_TRACE(minutes);
        orders.clear();
        stops_done.clear();
        utc_ns = stops[1].begun_utc_ns + minutes * 60 * drivers::kSecond;
        make();
        ASSERT_TRUE(campaign->offer(dwells, stops));
        ASSERT_TRUE(command(Kind::arm).accepted);
        ASSERT_TRUE(command(Kind::resume).accepted);
        ASSERT_TRUE(run_until(CampaignState::finished, 400));
        ASSERT_EQ(orders.size(), minutes < 60 ? 2U : 3U);
        if (minutes < 60) continue;
        EXPECT_EQ(orders[0].dwell.run, 1);
        EXPECT_EQ(orders[0].dwell.position, 5);
        EXPECT_EQ(orders[0].dwell.table_g, settings.table_g[0]);
        EXPECT_EQ(stops_done.at(0).position_deg, settings.positions_deg[1]);
    }
}

TEST_F(CampaignTest, EndsAResumedCampaignThatHadOnlyItsEndToCome) {
    ASSERT_TRUE(campaign->offer(done(4)));
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::resume).accepted);
    ASSERT_TRUE(run_until(CampaignState::finished, 60));
    EXPECT_TRUE(orders.empty());
    EXPECT_TRUE(shaker.requests.empty());
    EXPECT_EQ(ends, 1);
}

TEST_F(CampaignTest, ForgetsWhatItOfferedWhenStartedAnew) {
    ASSERT_TRUE(campaign->offer(done(3)));
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    EXPECT_EQ(status().resume_offer, "");
    EXPECT_TRUE(status().dwells.empty());
    ASSERT_TRUE(run_until(CampaignState::finished, 300));
    EXPECT_EQ(orders.size(), 4U);
}

}  // namespace
}  // namespace vibrig::campaign
