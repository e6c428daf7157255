#include "daemon/campaign/campaign.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/unit/campaign/fake_accelerometers.hpp"
#include "tests/unit/rt/fake_shaker.hpp"

namespace vibrig::campaign {
namespace {

using drivers::kMillisecond;
using drivers::kSecond;
using drivers::Time;
using Kind = CommandRequest::Kind;

/// Takes gimbal commands as the platform would: echoes the counter, then is in position after two
/// seconds.
class FakePlatformPort final : public drivers::CanPort {
  public:
    void start(FrameHandler, StateHandler, ErrorHandler) override {}
    void stop() noexcept override {}
    [[nodiscard]] bool send(const canfd_frame& frame, bool) noexcept override {
        frames.push_back(frame);
        return true;
    }
    [[nodiscard]] drivers::CanPortCounters counters() const noexcept override { return {}; }
    [[nodiscard]] drivers::PortState state() const noexcept override {
        return drivers::PortState::running;
    }
    std::vector<canfd_frame> frames;
};

struct CampaignTest : testing::Test {
    Settings settings;
    proto::Dbc dbc = proto::parse_dbc(proto::rig_dbc_text(), "rig.dbc");
    FakePlatformPort port;
    drivers::Gimbal gimbal{dbc, {}, port};
    FakeShaker shaker;
    drivers::PlatformStatus platform;
    std::vector<rt::DwellOrder> orders;
    std::vector<std::string> events;
    rt::Guard guard = rt::Guard::idle;
    int ends = 0;
    int positions_done = 0;
    std::string gate;
    bool complete = false;
    bool slewed_while_moving = false;
    FakeAccelerometers accelerometers;
    bool disobeyed = false;
    double slew_started_at = -1;
    std::size_t frames_seen = 0;
    Time now = kSecond;
    std::unique_ptr<Campaign> campaign;

    void make() {
        Ports ports{gimbal,
                    shaker,
                    [this] { return platform; },
                    [this](const rt::DwellOrder& o) {
                        orders.push_back(o);
                        return true;
                    },
                    [this](rt::Guard g) { guard = g; },
                    [] { return true; },
                    [] {},
                    [this](bool c) {
                        ++ends;
                        complete = c;
                    },
                    [this](Severity, const std::string& text) { events.push_back(text); },
                    [this](const std::array<double, 3>& here, double elapsed_s) {
                        return think(here, elapsed_s);
                    },
                    {},
                    [this](const estimator::DwellInfo&, const estimator::DwellSummary&,
                           const StopDone& stop) {
                        ++positions_done;
                        stops_done.push_back(stop);
                    },
                    [this] { return gate; },
                    {}};
        ports.rest = [this](Time at) { return accelerometers.monitor.rest(at); };
        ports.disobeyed = [this](bool now_so) { disobeyed = disobeyed || now_so; };
        campaign = std::make_unique<Campaign>(settings, ports);
    }

    CampaignTest() {
        settings.sample_s = 0.025;
        settings.positions_deg = {{0, 0, 0}, {0, 0, 90}};
        settings.table_g = {9, 0};
        settings.dwell_s = 10;
        settings.temperature_window_s = 5;
        platform.ready = platform.loop_closed = platform.gyros_at_speed = true;
        platform.temperature_c = 40;
        shaker.now.valid = true;
        make();
    }

    std::optional<Next> think(const std::array<double, 3>& here, double elapsed_s) {
        if (thinking_steps > 0) {
            --thinking_steps;
            return {};
        }
        asked_from.push_back(here);
        elapsed.push_back(elapsed_s);
        if (asked_from.size() > stops_to_choose.size())
            return Next{false, {}, 0, "every target is met"};
        return Next{true, stops_to_choose[asked_from.size() - 1], 1, "more"};
    }

    CommandReply command(Kind kind) { return campaign->command({kind, "Ada", ""}, now); }

    StatusData status() const {
        StatusData s;
        campaign->fill(s, now);
        return s;
    }

    /// The rest of the rig for one step of 100 ms.
    void run_rig() {
        now += 100 * kMillisecond;
        platform.time = platform.gimbal_time = now;
        for (; frames_seen < port.frames.size(); ++frames_seen) {
            const auto& frame = port.frames[frames_seen];
            platform.gimbal_command_echo = frame.data[7];
            const bool slews = (frame.data[6] & 0x0f) == 1;
            platform.slewing = slews;
            platform.in_position = false;
            slew_started_at = slews ? drivers::to_seconds(now) : -1;
            if (slews && !shaker.now.at_rest()) slewed_while_moving = true;
        }
        if (slew_started_at >= 0 && drivers::to_seconds(now) > slew_started_at + 2) {
            platform.slewing = false;
            platform.in_position = true;
        }
        if (shaker_obeys) shaker.obey(now);
        shaker.now.time = now;
        accelerometers.run_to(now, shaker.now.measured_g);
        if (!orders.empty() && !orders.back().cancel && now > orders.back().to &&
            reported != orders.size()) {
            reported = orders.size();
            estimator::DwellSummary summary;
            summary.run = orders.back().dwell.run;
            summary.position = orders.back().dwell.position;
            summary.flagged = orders.size() == flagged_order;
            campaign->on_dwell_done(summary);
        }
        campaign->step(now);
    }
    bool shaker_obeys = true;
    std::size_t reported = 0;
    std::size_t flagged_order = 0;
    std::vector<Stop> stops_to_choose;
    std::vector<std::array<double, 3>> asked_from;
    std::vector<double> elapsed;
    std::vector<StopDone> stops_done;
    int thinking_steps = 0;

    void run_for(double seconds) {
        for (int i = 0; i < static_cast<int>(seconds * 10); ++i) run_rig();
    }
    bool run_until(CampaignState state, double seconds) {
        for (int i = 0; i < static_cast<int>(seconds * 10); ++i) {
            run_rig();
            if (status().state == state) return true;
        }
        return false;
    }
};

TEST_F(CampaignTest, NothingMovesBeforeANamedPersonArmsAndStarts) {
    // WHEN time passes, or somebody starts without arming, or nameless
    run_for(30);
    EXPECT_FALSE(command(Kind::start).accepted);
    EXPECT_FALSE(campaign->command({Kind::arm, "", ""}, now).accepted);
    run_for(30);
    // THEN neither the shaker nor the gimbals were told anything
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

TEST_F(CampaignTest, WaitsForTheFirstPlatformStatus) {
    // GIVEN a campaign started before the platform has said anything
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    platform.time = 0;
    // WHEN the campaign looks at it, THEN it waits and says for what
    for (int i = 0; i < 3; ++i) campaign->step(now += 100 * kMillisecond);
    EXPECT_EQ(status().state, CampaignState::waiting);
    EXPECT_EQ(status().reason, "no platform status on the bus");
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
    const auto stops = shaker.stops_asked.load();
    EXPECT_EQ(command(Kind::acknowledge).message,
              "acknowledged: emergency-stop chain open; shaker fault 0x0002");
    EXPECT_EQ(shaker.stops_asked, stops + 1);
    EXPECT_EQ(command(Kind::arm).message, "a stop of the shaker is pending");
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
    // THEN the stop is told as not obeyed after 3 s, and never as confirmed
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

TEST_F(CampaignTest, AnAdaptiveCampaignRepeatsFlaggedDwellsAndEndsWhenToldTo) {
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
    EXPECT_FALSE(campaign->offer({done(3)[1]})) << "not the first";
    EXPECT_TRUE(campaign->offer(done(3)));
    EXPECT_EQ(status().resume_offer, "3 of 4 positions done");
    // WHEN nobody does anything, or resumes without arming, THEN nothing moves
    run_for(30);
    EXPECT_FALSE(command(Kind::resume).accepted);
    run_for(30);
    EXPECT_TRUE(shaker.requests.empty());
    EXPECT_TRUE(port.frames.empty());
    // WHEN armed, THEN still nothing moves
    ASSERT_TRUE(command(Kind::arm).accepted);
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
