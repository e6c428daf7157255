#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "daemon/campaign/campaign.hpp"
#include "daemon/campaign/rig_frame.hpp"
#include "tests/unit/daemon/campaign/fake_accelerometers.hpp"
#include "tests/unit/daemon/interlock/fake_shaker.hpp"

namespace vibrig::campaign {

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

/// Gravity, vibration and what becomes of dwells are the test's.
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

}  // namespace vibrig::campaign
