#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/campaign/campaign.hpp"
#include "tests/unit/rt/fake_shaker.hpp"

namespace vibrig::campaign {
namespace {

using drivers::kSecond;
using drivers::Time;
using testing::HasSubstr;
using Kind = CommandRequest::Kind;

class SilentPort final : public drivers::CanPort {
  public:
    void start(FrameHandler, StateHandler, ErrorHandler) override {}
    void stop() noexcept override {}
    [[nodiscard]] bool send(const canfd_frame&, bool) noexcept override { return true; }
    [[nodiscard]] drivers::CanPortCounters counters() const noexcept override { return {}; }
    [[nodiscard]] drivers::PortState state() const noexcept override {
        return drivers::PortState::running;
    }
};

/// A shaker at rest that can be armed; people's time is the test's.
struct ArmingTest : testing::Test {
    Settings settings;
    proto::Dbc dbc = proto::parse_dbc(proto::rig_dbc_text(), "rig.dbc");
    SilentPort port;
    drivers::Gimbal gimbal{dbc, {}, port};
    FakeShaker shaker;
    std::vector<std::string> events;
    Time now = kSecond, wall = 77 * kSecond;
    std::unique_ptr<Campaign> campaign;

    ArmingTest() {
        settings.name = "night";
        settings.positions_deg = {{0, 0, 0}, {0, 0, 90}};
        settings.table_g = {7, 9};
        settings.dwell_s = 100;
        shaker.now.valid = true;
    }
    CommandReply command(Kind kind, const char* by = "Ada") {
        if (!campaign) make();
        return campaign->command({kind, by, ""}, now);
    }
    void make() {
        Ports ports{gimbal,
                    shaker,
                    [] { return drivers::PlatformStatus{}; },
                    [](const rt::DwellOrder&) { return true; },
                    [](rt::Guard) {},
                    [] { return true; },
                    [] {},
                    [](bool) {},
                    [this](Severity, const std::string& text) { events.push_back(text); }};
        ports.wall = [this] { return wall; };
        campaign = std::make_unique<Campaign>(settings, std::move(ports));
    }
    void pass(double seconds) {
        wall += drivers::from_seconds(seconds);
        shaker.now.time = now += drivers::kMillisecond;
        campaign->step(now);
    }
    [[nodiscard]] StatusData status() const {
        StatusData s;
        campaign->fill(s, now);
        return s;
    }
};

TEST_F(ArmingTest, NamesUnitPlanHighestLevelAndDuration) {
    settings.unit = "IMU-7 0042";
    const auto reply = command(Kind::arm);
    ASSERT_TRUE(reply.accepted) << reply.message;
    // 4 positions of 100 s, 3 s of settling and 2 ramps of 2 s each
    const char* const expected =
        "IMU-7 0042, plan \"night\" (4 positions), up to 9 g at the table, about 7 min; to be "
        "started within 10 min";
    EXPECT_EQ(reply.message, std::string("armed for ") + expected);
    EXPECT_EQ(status().armed_for, expected);
    EXPECT_EQ(status().arming_left_s, 600);
    ASSERT_FALSE(events.empty());
    EXPECT_EQ(events.back(), std::string("armed for ") + expected + " by Ada");
}

TEST_F(ArmingTest, SaysThatNoUnitIsStated) {
    EXPECT_THAT(command(Kind::arm).message, HasSubstr("armed for a unit that is not stated, plan"));
}

TEST_F(ArmingTest, EndsAfterItsTimeWithoutAStart) {
    settings.arming_valid_s = 30;
    ASSERT_TRUE(command(Kind::arm).accepted);
    pass(29.9);
    EXPECT_EQ(status().state, CampaignState::armed);
    EXPECT_NEAR(status().arming_left_s, 0.1, 1e-9);
    pass(0.1);
    EXPECT_EQ(status().state, CampaignState::idle);
    EXPECT_EQ(campaign->armed_by(), "");
    EXPECT_EQ(status().armed_for, "");
    EXPECT_EQ(events.back(), "the arming by Ada has expired: not started within 30 s");
    EXPECT_FALSE(command(Kind::start).accepted);
    // and can be had again
    EXPECT_TRUE(command(Kind::arm).accepted);
}

TEST_F(ArmingTest, OfARunningCampaignDoesNotExpire) {
    settings.arming_valid_s = 30;
    ASSERT_TRUE(command(Kind::arm).accepted);
    ASSERT_TRUE(command(Kind::start).accepted);
    pass(3600);
    EXPECT_EQ(campaign->armed_by(), "Ada");
    EXPECT_EQ(status().arming_left_s, 0);
}

TEST_F(ArmingTest, IsNamedWhenAnotherPersonStarts) {
    ASSERT_TRUE(command(Kind::arm).accepted);
    EXPECT_EQ(command(Kind::start, "Grace").message, "campaign started, armed by Ada");
    EXPECT_EQ(status().started_by, "Grace");
    // AND a second start is told what is going on
    const auto again = command(Kind::start, "Ada");
    EXPECT_FALSE(again.accepted);
    EXPECT_EQ(again.message, "a campaign is running, started by Grace");
}

TEST_F(ArmingTest, IsRefusedWhileAnEarlierLifesLatchIsNotAcknowledged) {
    make();
    campaign->take_over_trip("the daemon ended while armed by Ada");
    EXPECT_EQ(status().state, CampaignState::tripped);
    pass(10);
    const auto refused = command(Kind::arm);
    EXPECT_FALSE(refused.accepted);
    EXPECT_THAT(refused.message, HasSubstr("ended while armed by Ada"));
    EXPECT_EQ(campaign->refusal({Kind::arm, "Grace", ""}, now), refused.message);
    EXPECT_TRUE(shaker.requests.empty());
    EXPECT_TRUE(command(Kind::acknowledge, "Grace").accepted);
    EXPECT_EQ(campaign->refusal({Kind::arm, "Grace", ""}, now), "");
    EXPECT_TRUE(command(Kind::arm).accepted);
}

}  // namespace
}  // namespace vibrig::campaign
