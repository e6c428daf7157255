#pragma once

#include "daemon/campaign/campaign.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/unit/daemon/campaign/fake_accelerometers.hpp"
#include "tests/unit/daemon/interlock/fake_shaker.hpp"

namespace vibrig::campaign {
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
    std::vector<rt::Ramp> ramps;
    std::vector<std::string> events;
    rt::Guard guard = rt::Guard::idle;
    int ends = 0;
    int positions_done = 0;
    std::string gate;
    bool complete = false;
    bool slewed_while_moving = false;
    FakeAccelerometers accelerometers;
    bool disobeyed = false;
    int uncommanded = 0, gimbals_led = 0, gimbals_silent = 0;
    bool gimbal_status = true;  ///< it comes
    bool temperature_comes = true;
    bool starts_by_itself = false;  ///< the table, in this test
    Proving proving = Proving::nothing;
    std::int64_t utc_ns = 0;
    std::function<Time()> steady_clock;      ///< people's; none: the machine's
    std::function<rt::MeanMotion()> second;  ///< of force and angles; none: nobody asks
    double slew_started_at = -1;
    std::size_t frames_seen = 0;
    Time now = kSecond;
    std::unique_ptr<Campaign> campaign;

    struct TestRig final : Rig {
        explicit TestRig(CampaignTest& t) : Rig(t.gimbal, t.shaker), test(t) {}
        CampaignTest& test;
        drivers::PlatformStatus platform() const override { return test.platform; }
        rt::Rest rest(Time at) const override { return test.accelerometers.monitor.rest(at); }
        std::optional<rt::MeanMotion> second() const override {
            if (!test.second) return {};
            // Nothing is asked for before there is a campaign.
            return test.campaign ? test.second() : rt::MeanMotion{};
        }
        void guard(rt::Guard level) override { test.guard = level; }
        void ramping(const rt::Ramp& ramp) override { test.ramps.push_back(ramp); }
        void proving(Proving what) override { test.proving = what; }
        void disobeyed(bool now_so) override { test.disobeyed = test.disobeyed || now_so; }
        void uncommanded() override {
            ++test.uncommanded;
            EXPECT_TRUE(test.starts_by_itself) << testing::PrintToString(test.events);
        }
        void gimbals_led() override { ++test.gimbals_led; }
        void gimbals_silent() override { ++test.gimbals_silent; }
    } rig_port{*this};
    struct TestDwells final : Dwells {
        explicit TestDwells(CampaignTest& t) : test(t) {}
        CampaignTest& test;
        bool order(const rt::DwellOrder& o) override {
            test.orders.push_back(o);
            return true;
        }
        std::optional<Next> next(const std::array<double, 3>& here, double elapsed_s) override {
            return test.think(here, elapsed_s);
        }
        std::string resume_gate() const override { return test.gate; }
        Played played(const ReportedPsd& psd) override {
            test.reported_psds.push_back(psd);
            return test.played;
        }
        void end(bool c) override {
            ++test.ends;
            test.complete = c;
        }
    } dwell_port{*this};
    struct TestLog final : Log {
        explicit TestLog(CampaignTest& t) : test(t) {}
        CampaignTest& test;
        void event(Severity, const std::string& text) override { test.events.push_back(text); }
        void position_done(const estimator::DwellInfo& info, const estimator::DwellSummary&,
                           const StopDone& stop) override {
            ++test.positions_done;
            test.infos_done.push_back(info);
            test.stops_done.push_back(stop);
        }
        void proved(const ProofRecord& record) override { test.proofs.push_back(record); }
        std::int64_t utc_ns() const override { return test.utc_ns; }
        Time steady_now() const override {
            return test.steady_clock ? test.steady_clock() : Log::steady_now();
        }
    } log_port{*this};

    void make() {
        campaign = std::make_unique<Campaign>(settings, Ports{rig_port, dwell_port, log_port});
    }

    CampaignTest() {
        settings.sample_s = 0.025;
        settings.proof.demanded = false;
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
        platform.time = now;
        if (temperature_comes) platform.temperature_time = now;
        if (gimbal_status) platform.gimbal_time = now;
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
            summary.samples = 400;
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
    std::vector<estimator::DwellInfo> infos_done;
    std::vector<ReportedPsd> reported_psds;
    Played played;
    std::vector<ProofRecord> proofs;
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

}  // namespace vibrig::campaign
