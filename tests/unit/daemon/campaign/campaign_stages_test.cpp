#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "daemon/campaign/campaign.hpp"
#include "daemon/campaign/rig_frame.hpp"
#include "daemon/campaign/stages/zeroing.hpp"
#include "estimator/filter/angles.hpp"
#include "tests/unit/daemon/campaign/fake_accelerometers.hpp"
#include "tests/unit/daemon/interlock/fake_shaker.hpp"
#include "tests/unit/drivers/rig_frames.hpp"

namespace vibrig::campaign {
namespace {

using drivers::kMillisecond;
using drivers::kSecond;
using drivers::Time;
using Kind = CommandRequest::Kind;
using testing::HasSubstr;

using estimator::kRadPerDeg;
constexpr double kRadPerSecond = kRadPerDeg / 3600;  // of 1 deg/h

double signal(const proto::Dbc& dbc, const char* message, const char* name,
              const canfd_frame& frame) {
    return *proto::decode(*dbc.find(std::string_view(message))->find(name),
                          std::span(frame.data, frame.len));
}

constexpr double kSample_s = 0.025;

/// A platform in position (0, 0, 0) that obeys gimbal and torque commands: the vertical in its axes
/// goes round against it, u' = u x w.
struct StagesTest : testing::Test, drivers::CanPort {
    Settings settings;
    proto::Dbc dbc = proto::parse_dbc(proto::rig_dbc_text(), "rig.dbc");
    drivers::Gimbal gimbal{dbc, {}, *this};
    drivers::Torquer torquer{dbc, {}, *this};
    FakeShaker shaker;
    drivers::PlatformStatus platform;
    std::unique_ptr<rt::StageFeed> feed;
    std::unique_ptr<Campaign> campaign;

    struct StagedRig final : Rig {
        explicit StagedRig(StagesTest& t) : Rig(t.gimbal, t.shaker), test(t) {}
        StagesTest& test;
        drivers::PlatformStatus platform() const override { return test.platform; }
        rt::Rest rest(Time at) const override { return test.accelerometers.monitor.rest(at); }
        void guard(rt::Guard level) override { test.guard = level; }
        void uncommanded() override { ++test.uncommanded; }
    } rig_port{*this};
    struct StagedDwells final : Dwells {
        explicit StagedDwells(StagesTest& t) : test(t) {}
        StagesTest& test;
        bool order(const rt::DwellOrder& o) override {
            test.orders.push_back(o);
            test.tilt_when_ordered = std::hypot(test.up[0], test.up[2]);
            return true;
        }
        void levelled(const LevelDrift& found) override { test.drifts.push_back(found); }
    } dwell_port{*this};
    struct StagedLog final : Log {
        explicit StagedLog(StagesTest& t) : test(t) {}
        StagesTest& test;
        void event(Severity, const std::string& text) override { test.events.push_back(text); }
    } log_port{*this};
    std::vector<rt::DwellOrder> orders;
    std::vector<LevelDrift> drifts;
    std::vector<std::string> events;
    std::size_t reported = 0;
    rt::Guard guard = rt::Guard::idle;
    int uncommanded = 0;
    FakeAccelerometers accelerometers;
    Time now = kSecond;

    StagesTest() {
        settings.sample_s = kSample_s;
        settings.proof.demanded = false;
    }

    std::array<double, 3> up{0.005, 1, -0.003}, torque{}, drift{10, 3, -6};  // deg/h
    std::array<double, 3> encoder_deg{}, target_deg{};                       // last commanded
    double torquer_sign = 1;
    bool silent = false, says_torquing = false, slews = false;
    std::uint8_t torque_echo = 0;
    double slewed_s = 0;
    double tilt_when_ordered = -1;
    bool torqued_in_dwell = false, shook_while_levelling = false;

    void start(FrameHandler, StateHandler, ErrorHandler) override {}
    void stop() noexcept override {}
    [[nodiscard]] drivers::CanPortCounters counters() const noexcept override { return {}; }
    [[nodiscard]] drivers::PortState state() const noexcept override {
        return drivers::PortState::running;
    }
    [[nodiscard]] bool send(const canfd_frame& frame, bool) noexcept override {
        if (frame.can_id == dbc.find("TorqueCommand")->id) {
            for (std::size_t i = 0; i < 3; ++i)
                torque[i] = signal(dbc, "TorqueCommand", std::array{"X", "Y", "Z"}[i], frame);
            torque_echo = static_cast<std::uint8_t>(signal(dbc, "TorqueCommand", "Counter", frame));
        } else {
            platform.gimbal_command_echo = frame.data[7];
            for (std::size_t i = 0; i < 3; ++i)
                target_deg[i] =
                    signal(dbc, "GimbalCommand", std::array{"Outer", "Inner", "Azimuth"}[i], frame);
            slews = (frame.data[6] & 0x0f) != 0;
            slewed_s = 0;
        }
        return true;
    }

    void begin() {
        for (int i = 0; campaign && i < 40; ++i) tick();  // the last one's shaker comes to rest
        make();
        for (int i = 0; campaign->stopping() && i < 40; ++i) tick();
        ASSERT_TRUE(campaign->command({Kind::arm, "Ada", ""}, now).accepted);
        ASSERT_TRUE(campaign->command({Kind::start, "Ada", ""}, now).accepted);
    }

    void make() {
        settings.positions_deg = {{0, 0, 0}, {0, 0, 0}};
        settings.table_g = {9};
        settings.dwell_s = 10;
        settings.temperature_window_s = 0;
        platform.ready = platform.loop_closed = platform.gyros_at_speed = true;
        shaker.now.valid = true;
        feed = std::make_unique<rt::StageFeed>(dbc, stage_feed_settings(settings), nullptr);
        rig_port.torquer = &torquer;
        rig_port.feed = feed.get();
        campaign = std::make_unique<Campaign>(settings, Ports{rig_port, dwell_port, log_port});
    }

    StatusData status() const {
        StatusData s;
        campaign->fill(s, now);
        return s;
    }

    void tick() {
        constexpr double kTick = kSample_s;
        now += 25 * kMillisecond;
        slewed_s += kTick;
        if (!slews) {
            std::array<double, 3> w{};
            for (std::size_t i = 0; i < 3; ++i)
                w[i] = kRadPerSecond * (drift[i] + torquer_sign * torque[i]);
            const auto u = up;
            const auto change = cross(u, w);
            for (std::size_t i = 0; i < 3; ++i) up[i] = u[i] + kTick * change[i];
        }
        platform.time = platform.gimbal_time = now;
        platform.slewing = slews && slewed_s < 2;
        platform.in_position = slews && slewed_s >= 2;
        const bool torquing = says_torquing || torque != std::array<double, 3>{};
        static_cast<void>(feed->take(
            test::frame_of(dbc, "GimbalStatus", now,
                           {{"Torquing", torquing ? 1 : 0}, {"TorqueEcho", torque_echo}})));
        drivers::Sample sample;
        sample.time = now;
        sample.force = up;
        for (std::size_t i = 0; i < 3; ++i) sample.angle[i] = kRadPerDeg * encoder_deg[i];
        if (!silent) feed->take(sample);
        shaker.obey(now);
        accelerometers.run_to(now, shaker.now.measured_g);
        if (orders.size() > reported && !orders.back().cancel && now > orders.back().to) {
            reported = orders.size();
            estimator::DwellSummary summary;
            summary.run = orders.back().dwell.run;
            summary.position = orders.back().dwell.position;
            campaign->on_dwell_done(summary);
        }
        campaign->step(now);
        const auto state = status().state;
        if (state == CampaignState::recording && torque != std::array<double, 3>{})
            torqued_in_dwell = true;
        if (state == CampaignState::levelling && !shaker.now.at_rest())
            shook_while_levelling = true;
    }
    bool run_until(CampaignState wanted, double seconds) {
        for (int i = 0; i < static_cast<int>(seconds * 40); ++i) {
            tick();
            if (status().state == wanted) return true;
        }
        return false;
    }
};

TEST_F(StagesTest, LevelsBeforeEachPositionAndLetsThePlatformDriftFreelyDuringTheDwell) {
    // GIVEN a platform 20' off level that drifts by 10 deg/h
    settings.levelling = true;
    begin();
    // WHEN the campaign runs
    ASSERT_TRUE(run_until(CampaignState::levelling, 60));
    EXPECT_EQ(guard, rt::Guard::armed);
    ASSERT_TRUE(run_until(CampaignState::finished, 600)) << testing::PrintToString(events);
    // THEN each dwell began level but for its free drift since, nothing torqued, nothing shook
    EXPECT_EQ(orders.size(), 2U);
    // 0.2' of tolerance and 12 deg/h for the 3 s until the order goes out
    EXPECT_LT(tilt_when_ordered, (0.2 / 60 + 12.0 * 3 / 3600) * kRadPerDeg);
    EXPECT_FALSE(torqued_in_dwell);
    EXPECT_FALSE(shook_while_levelling);
    EXPECT_EQ(status().levelling.done, 2U);
    // AND the drift was found: first and second channel lie across the vertical
    const auto found = status().levelling.drift_deg_h;
    EXPECT_NEAR(std::hypot(found[0], found[1]), std::hypot(drift[0], drift[2]), 0.2);
    // AND reported as what the platform does along either direction, within what it says of itself
    ASSERT_EQ(drifts.size(), 2U);
    EXPECT_EQ(drifts[1].position, 2);
    EXPECT_LT(drifts[1].sigma_deg_h, 0.5);
    for (std::size_t a = 0; a < 2; ++a) {
        EXPECT_NEAR(drifts[1].rate_deg_h[a], dot(drifts[1].direction[a], drift),
                    4 * drifts[1].sigma_deg_h);
    }
}

TEST_F(StagesTest, WhatCannotWorkIsRefusedBeforehandWithKeyValueAndWhatIsExpected) {
    const auto check = [this] { return check_stages(settings, dbc, *this); };
    settings.levelling = settings.zeroing = true;
    EXPECT_EQ(check(), "");
    // GIVEN a tolerance that the mean of ten blocks cannot hold: 1e-4 g / sqrt(40) is 0.054'
    settings.level.tolerance_arcmin = 0.05;
    settings.level.window_s = 1;
    const std::string narrow = check();
    for (const char* word : {"levelling.tolerance_arcmin: found 0.05, expected at least 0.22",
                             "levelling.window_s = 1", "noise.accelerometer_g = 0.0001"}) {
        EXPECT_THAT(narrow, HasSubstr(word));
    }
    settings.level.tolerance_arcmin = 0.001;
    EXPECT_THAT(check(), HasSubstr("levelling.tolerance_arcmin: found 0.001, expected at least"));
    settings.level = {};
    // GIVEN gyros whose noise no window of the accelerometers' mean makes less
    settings.rig.gyro_random_walk_deg_per_rt_h = 0.1;
    EXPECT_THAT(check(), HasSubstr("noise.gyro_random_walk_deg_per_rt_h = 0.1"));
    settings.rig = {};
    // GIVEN a loop faster than its steps of 0.1 s allow: 5.24985 x 0.1 s / 0.05
    settings.level.settling_s = 10;
    EXPECT_THAT(check(), HasSubstr("levelling.settling_s: found 10, expected at least 10.5"));
    settings.level.settling_s = 10.5;
    settings.level.window_s = 5;
    EXPECT_EQ(check(), "");
    settings.level = {};
    // GIVEN a window that leaves no time for the loop to settle before it: 3 x 100 s - 100 s -
    // 1/sigma
    settings.level.window_s = 190;
    EXPECT_THAT(check(), HasSubstr("levelling.window_s: found 190, expected at most 180"));
    settings.level.window_s = 180;
    EXPECT_EQ(check(), "");
    settings.level = {};
    // GIVEN gains so far apart that some on the straight way between them are unstable
    for (const double slow_s : {1000.0, 5.0}) {
        settings.level.slow_settling_s = slow_s;
        EXPECT_THAT(check(), HasSubstr("levelling.slow_settling_s: found")) << slow_s;
        EXPECT_THAT(check(), HasSubstr("unstable")) << slow_s;
    }
    settings.level = {};
    // GIVEN a velocity's noise without the velocity
    settings.level.velocity_noise_mps = 0.01;
    EXPECT_THAT(check(), HasSubstr("levelling.velocity_noise_mps: found 0.01, expected 0"));
    settings.level = {};
    // GIVEN zeroings of less than what one sweep and the first fixes take; 90 s do
    settings.zero.duration_s = 60;
    EXPECT_THAT(check(),
                HasSubstr("zeroing.duration_s: found 60, expected more than 70.4, one sweep"
                          " there and back with zeroing.slew_deg_per_s = 5"));
    settings.zero.duration_s = 75;
    EXPECT_THAT(check(), HasSubstr("zeroing.duration_s: found 75, expected at least "));
    settings.zero.duration_s = 90;
    EXPECT_EQ(check(), "");
    settings.zero.duration_s = 60;
    settings.zero.slew_deg_per_s = 0.1;
    EXPECT_THAT(check(), HasSubstr("expected more than 3520, one sweep there and back with "
                                   "zeroing.slew_deg_per_s = 0.1"));
    // GIVEN a target that no zeroing reaches
    settings.zero = {};
    settings.zero.target_mg = {0.15, 1e-6, 0.01};
    EXPECT_THAT(check(), HasSubstr("zeroing.target_mg: found 1e-06 for y, expected more than"));
}

TEST_F(StagesTest, GoesOverToQuieterGainsOnceSettledAndOnlyThenBeginsTheDwell) {
    // GIVEN gains of 300 s to go over to within 20 s
    settings.levelling = true;
    settings.level.slow_settling_s = 300;
    settings.level.slow_ramp_s = 20;
    begin();
    ASSERT_TRUE(run_until(CampaignState::levelling, 60));
    // WHEN it has settled
    while (status().levelling.verdict != std::string("settled") && now < 400 * kSecond) tick();
    const Time settled = now;
    EXPECT_EQ(status().levelling.phase, std::string("ramp"));
    // THEN the table shakes 20 s later at the earliest, the platform still level
    ASSERT_TRUE(run_until(CampaignState::ramping, 60)) << testing::PrintToString(events);
    EXPECT_GE(now - settled, 20 * kSecond);
    EXPECT_LT(now - settled, 23 * kSecond);
    EXPECT_LT(std::hypot(up[0], up[2]), 2 * 0.2 / 60 * kRadPerDeg);
}

TEST_F(StagesTest, TorquersTheWrongWayRoundCannotSettleAndNoDataAreTaken) {
    settings.levelling = true;
    torquer_sign = -1;
    begin();
    ASSERT_TRUE(run_until(CampaignState::aborted, 400));
    EXPECT_THAT(status().reason, HasSubstr("cannot settle"));
    EXPECT_THAT(status().reason, HasSubstr("sign or axes of the torquers"));
    EXPECT_TRUE(orders.empty());
    // AND the torquers are let go
    tick();
    EXPECT_EQ(torque, (std::array<double, 3>{}));
    EXPECT_EQ(
        std::ranges::count_if(
            events, [](const auto& e) { return e.find("cannot settle") != std::string::npos; }),
        1);
}

/// Killed while it levelled: the platform goes on as it was commanded last, for ever.
TEST_F(StagesTest, EndsTheTorqueOfADaemonThatDiedArmed) {
    settings.levelling = true;
    make();
    torque = {60, 0, 0};
    campaign->take_over_trip("the daemon ended while armed by Ada");
    tick();
    EXPECT_EQ(torque, (std::array<double, 3>{}));
    // WHEN the platform did not hear it, it is said again
    torque = {60, 0, 0};
    for (int i = 0; i < 10; ++i) tick();
    EXPECT_EQ(torque, (std::array<double, 3>{}));
    // THEN not of a rig that nobody had armed: who torques it there is not this daemon
    make();
    torque = {60, 0, 0};
    for (int i = 0; i < 10; ++i) tick();
    EXPECT_EQ(torque, (std::array<double, 3>{60, 0, 0}));
}

/// Killed while it was commissioned: nothing was armed, and nothing is latched.
TEST_F(StagesTest, EndsTheTorqueOfADaemonThatDiedWhileItWasCommissioned) {
    make();
    torque = {0, 60, 0};
    campaign->take_over_torque();
    tick();
    EXPECT_EQ(torque, (std::array<double, 3>{}));
    EXPECT_EQ(status().state, CampaignState::idle) << "nobody has to acknowledge it";
    EXPECT_FALSE(campaign->torque_ended(now)) << "the platform has not confirmed it yet";
    // WHEN the platform did not hear it, it is said again
    torque = {0, 60, 0};
    for (int i = 0; i < 10; ++i) tick();
    EXPECT_EQ(torque, (std::array<double, 3>{}));
    EXPECT_FALSE(campaign->torque_ended(now));
    // THEN it is over once the platform has shown for a second that it heard
    for (int i = 0; i < 42; ++i) tick();
    EXPECT_TRUE(campaign->torque_ended(now));
    // AND not once it is commissioned again, with torques of its own
    for (int i = 0; i < 1000 && campaign->begin_commissioning("Ada", now) != ""; ++i) tick();
    ASSERT_TRUE(campaign->commissioning());
    torque = {0, 60, 0};
    for (int i = 0; i < 10; ++i) tick();
    EXPECT_EQ(torque, (std::array<double, 3>{0, 60, 0}));
    campaign->end_commissioning(now);
    for (int i = 0; i < 10; ++i) tick();
    EXPECT_EQ(torque, (std::array<double, 3>{0, 60, 0})) << "whoever did that";
}

TEST_F(StagesTest, AbortsWithOneClearReasonWhenAStageCannotGoOn) {
    settings.levelling = true;
    begin();
    // Silence while levelling
    ASSERT_TRUE(run_until(CampaignState::levelling, 60));
    silent = true;
    ASSERT_TRUE(run_until(CampaignState::aborted, 5));
    EXPECT_THAT(status().reason, HasSubstr("no specific force"));
    // A platform that goes on torquing after the zero command
    silent = false;
    up = {0.001, 1, 0};
    begin();
    ASSERT_TRUE(run_until(CampaignState::levelling, 60));
    says_torquing = true;
    ASSERT_TRUE(run_until(CampaignState::aborted, 300));
    EXPECT_THAT(status().reason, HasSubstr("not confirmed"));
    // One that begins to torque during a dwell
    says_torquing = false;
    up = {0.001, 1, 0};
    begin();
    ASSERT_TRUE(run_until(CampaignState::recording, 300));
    says_torquing = true;
    ASSERT_TRUE(run_until(CampaignState::aborted, 5));
    EXPECT_THAT(status().reason, HasSubstr("torqued during a dwell"));
    // A zeroing without increments
    says_torquing = false;
    settings.levelling = false;
    settings.zeroing = true;
    begin();
    ASSERT_TRUE(run_until(CampaignState::zeroing, 60));
    ASSERT_TRUE(run_until(CampaignState::aborted, 60));
    EXPECT_THAT(status().reason, HasSubstr("no increments"));
}

TEST_F(StagesTest, LevelsBeforeTheZeroingAndThenTurnsTheAzimuthOnly) {
    // GIVEN platform z nearly up, the outer gimbal 0.3 deg beside its target
    settings.levelling = settings.zeroing = true;
    up = {0.004, -0.003, 1};
    encoder_deg = {90.3, -0.2, 0};
    begin();
    // WHEN the campaign begins with the zeros
    ASSERT_TRUE(run_until(CampaignState::zeroing, 60));
    EXPECT_EQ(target_deg[0], 90);
    ASSERT_TRUE(run_until(CampaignState::levelling, 60));
    ASSERT_TRUE(run_until(CampaignState::zeroing, 300)) << testing::PrintToString(events);
    // THEN the platform is level and let go before the first slew of the azimuth
    EXPECT_LT(std::hypot(up[0], up[1]), 2 * 0.2 / 60 * kRadPerDeg);
    EXPECT_EQ(torque, (std::array<double, 3>{}));
    EXPECT_EQ(status().levelling.done, 1U);
    // AND outer and inner gimbal are held where that was
    for (int i = 0; i < 120; ++i) tick();
    EXPECT_THAT(target_deg, testing::ElementsAre(testing::DoubleNear(90.3, 0.005),
                                                 testing::DoubleNear(-0.2, 0.005),
                                                 testing::DoubleNear(88, 0.005)));
    // WHEN it cannot be levelled, THEN no zeros are taken
    torquer_sign = -1;
    up = {0.004, -0.003, 1};
    begin();
    ASSERT_TRUE(run_until(CampaignState::aborted, 400));
    EXPECT_THAT(status().reason, HasSubstr("levelling: cannot settle"));
    EXPECT_THAT(status().reason, HasSubstr("zeroing"));
}

TEST_F(StagesTest, ATableThatStartsByItselfWhileItLevelsOrTakesZerosIsUncommanded) {
    // GIVEN a rig without an accelerometer on the table
    accelerometers.table_bound = false;
    for (const auto stage : {CampaignState::levelling, CampaignState::zeroing}) {
        settings.levelling = stage == CampaignState::levelling;
        settings.zeroing = !settings.levelling;
        begin();
        ASSERT_TRUE(run_until(stage, 60));
        for (int i = 0; i < 80; ++i) tick();
        ASSERT_EQ(uncommanded, 0);
        accelerometers.table_g = 4.9;
        for (int i = 0; i < 60; ++i) tick();
        EXPECT_EQ(uncommanded, 1) << "within 1.5 s of " << testing::PrintToString(events);
        accelerometers.table_g.reset();
        uncommanded = 0;
    }
}

TEST_F(StagesTest, AnAbortWhileLevellingLetsTheTorquersGo) {
    settings.levelling = true;
    begin();
    ASSERT_TRUE(run_until(CampaignState::levelling, 60));
    for (int i = 0; i < 200; ++i) tick();
    ASSERT_NE(torque, (std::array<double, 3>{}));
    EXPECT_TRUE(campaign->command({Kind::abort, "Ada", ""}, now).accepted);
    EXPECT_EQ(torque, (std::array<double, 3>{}));
}

TEST_F(StagesTest, ACampaignHasNoRateThatNobodyStated) {
    settings.sample_s = 0;
    const Ports ports{rig_port, dwell_port, log_port};
    EXPECT_THROW(Campaign(settings, ports), std::invalid_argument);
}

TEST_F(StagesTest, ZeroingTakesTheCampaignsRate) {
    settings.rig.accelerometer_g = 1e-3;
    for (const double rate_hz : {40.0, 100.0, 1000.0}) {
        settings.sample_s = 1 / rate_hz;
        const Zeroing stage(settings, rig_port, log_port, false);
        EXPECT_DOUBLE_EQ(stage.calibration().plan().noise.velocity_random_walk,
                         1e-3 / std::sqrt(rate_hz));
    }
}

}  // namespace
}  // namespace vibrig::campaign
