// Before each ramp: gravity against the encoders, dwells that were rejected, samples that do not
// fit.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "daemon/campaign/campaign.hpp"
#include "daemon/campaign/rig_frame.hpp"
#include "tests/unit/daemon/campaign/fake_accelerometers.hpp"
#include "tests/unit/daemon/interlock/fake_shaker.hpp"

namespace vibrig::campaign {
namespace {

/// The gimbals take every command at once.
class PromptGimbals final : public drivers::CanPort {
  public:
    explicit PromptGimbals(drivers::PlatformStatus& status) : status_(status) {}
    void start(FrameHandler, StateHandler, ErrorHandler) override {}
    void stop() noexcept override {}
    [[nodiscard]] bool send(const canfd_frame& frame, bool) noexcept override {
        status_.gimbal_command_echo = frame.data[7];
        status_.in_position = true;
        return true;
    }
    [[nodiscard]] drivers::CanPortCounters counters() const noexcept override { return {}; }
    [[nodiscard]] drivers::PortState state() const noexcept override {
        return drivers::PortState::running;
    }

  private:
    drivers::PlatformStatus& status_;
};

struct WatchedCampaign : testing::Test {
    using Kind = CommandRequest::Kind;
    Settings settings;
    proto::Dbc dbc = proto::parse_dbc(proto::rig_dbc_text(), "rig.dbc");
    drivers::PlatformStatus platform;
    PromptGimbals port{platform};
    drivers::Gimbal gimbal{dbc, {}, port};
    FakeShaker shaker;
    FakeAccelerometers accelerometers;
    std::vector<rt::DwellOrder> orders;
    std::vector<std::string> events;
    std::vector<rt::Ramp> ramps;
    std::string unfit;
    estimator::Settings truth;       ///< of the rig
    double gravity = 1, across = 0;  ///< of 1 g; of the vibration
    bool watched = false, all_rejected = false, all_flagged = false;
    std::size_t reported = 0;
    drivers::Time now = drivers::kSecond;
    std::unique_ptr<Campaign> campaign;

    struct WatchedRig final : Rig {
        explicit WatchedRig(WatchedCampaign& t) : Rig(t.gimbal, t.shaker), test(t) {}
        WatchedCampaign& test;
        drivers::PlatformStatus platform() const override { return test.platform; }
        rt::Rest rest(drivers::Time at) const override {
            return test.accelerometers.monitor.rest(at);
        }
        std::optional<rt::MeanMotion> second() const override {
            // Nothing is asked for before there is a campaign.
            if (!test.watched) return {};
            return test.campaign ? test.second() : rt::MeanMotion{};
        }
        std::string unfit() const override { return test.unfit; }
        void guard(rt::Guard) override {}
        void ramping(const rt::Ramp& ramp) override {  // else: it rests
            if (ramp.start_g > 0 || ramp.target_g > 0) test.ramps.push_back(ramp);
        }
    } rig_port{*this};
    struct WatchedDwells final : Dwells {
        explicit WatchedDwells(WatchedCampaign& t) : test(t) {}
        WatchedCampaign& test;
        bool order(const rt::DwellOrder& order) override {
            if (!order.cancel) test.orders.push_back(order);
            return true;
        }
    } dwell_port{*this};
    struct WatchedLog final : Log {
        explicit WatchedLog(WatchedCampaign& t) : test(t) {}
        WatchedCampaign& test;
        void event(Severity, const std::string& text) override { test.events.push_back(text); }
    } log_port{*this};

    WatchedCampaign() {
        settings.sample_s = 0.025;
        settings.proof.demanded = false;
        settings.positions_deg = {{0, 0, 0}, {0, 0, 90}};
        settings.table_g = {9, 0};
        settings.dwell_s = 10;
        settings.temperature_window_s = 0;
        platform.ready = platform.loop_closed = platform.gyros_at_speed = true;
        shaker.now.valid = true;
        make();
    }
    void make() {
        campaign = std::make_unique<Campaign>(settings, Ports{rig_port, dwell_port, log_port});
    }
    CommandReply command(Kind kind) { return campaign->command({kind, "Ada", ""}, now); }
    StatusData status() const {
        StatusData s;
        campaign->fill(s, now);
        return s;
    }
    /// The last second, on a rig whose gimbals stand where they were sent.
    rt::MeanMotion second() const {
        const auto& deg = status().position_deg;
        rt::MeanMotion mean;
        mean.from = now - drivers::kSecond;
        mean.to = now;
        mean.good = true;
        for (std::size_t i = 0; i < 3; ++i) mean.angle[i] = deg[i] * std::numbers::pi / 180;
        const RigFrame frame(truth);
        mean.force = frame.to_raw(frame.up_at_deg(deg));
        for (double& force : mean.force) force *= gravity;
        const Vector up = frame.up_at_deg(deg);
        Vector aside{up[1], up[2], up[0]};
        const double part = dot(aside, up);
        for (std::size_t i = 0; i < 3; ++i) aside[i] -= part * up[i];
        const double size = std::sqrt(dot(aside, aside));
        Vector shaken{};
        for (std::size_t i = 0; i < 3; ++i)
            shaken[i] = shaker.now.measured_g * (up[i] + across * aside[i] / size);
        mean.sine = frame.to_raw(shaken);
        return mean;
    }
    void run_for(double seconds) {
        for (int n = 0; n < seconds * 10; ++n) step();
    }
    bool run_until(CampaignState state, double seconds) {
        for (int n = 0; n < seconds * 10; ++n) {
            step();
            if (status().state == state) return true;
        }
        return false;
    }
    void step() {
        now += 100 * drivers::kMillisecond;
        platform.time = platform.gimbal_time = now;
        shaker.obey(now);
        accelerometers.run_to(now, shaker.now.measured_g);
        if (reported < orders.size() && now > orders.back().to) {
            reported = orders.size();
            estimator::DwellSummary summary;
            summary.run = orders.back().dwell.run;
            summary.position = orders.back().dwell.position;
            summary.flagged = all_rejected || all_flagged;
            summary.left_out = all_rejected;
            summary.reason = all_rejected ? "mean force" : all_flagged ? "noise" : "";
            campaign->on_dwell_done(summary);
        }
        campaign->step(now);
    }
};

TEST_F(WatchedCampaign, TellsWhatTheTableIsToDoAsItIsTold) {
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

TEST_F(WatchedCampaign, AVibrationThatIsNotVerticalIsToldAndPausesAfterItsDwell) {
    watched = true;
    make();
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    ASSERT_TRUE(run_until(CampaignState::recording, 100));
    EXPECT_TRUE(events.empty() || events.back().find("off the vertical") == std::string::npos);
    // WHEN a third of the vibration goes across in one second THEN nothing is told
    across = 1.0 / 3;
    run_for(1);
    across = 0;
    run_for(2);
    const auto told = [this] {
        return std::ranges::count_if(events, [](const std::string& event) {
            return event.find("is 18.4 deg off the vertical") == event.npos
                       ? false
                       : event.starts_with("the vibration of");
        });
    };
    EXPECT_EQ(told(), 0);
    // WHEN it stays THEN that is told within three seconds
    across = 1.0 / 3;
    run_for(3);
    EXPECT_EQ(told(), 1);
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
    EXPECT_EQ(told(), 1);
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
