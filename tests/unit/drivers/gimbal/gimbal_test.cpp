#include "drivers/gimbal/gimbal.hpp"

#include <gtest/gtest.h>
#include <algorithm>

#include <cmath>
#include <limits>
#include <vector>

#include "drivers/sample/assembler.hpp"
#include "tests/unit/drivers/rig_frames.hpp"

namespace vibrig::test {
namespace {

using namespace drivers;

/// Records what is sent; the bus can be full.
class RecordingPort final : public CanPort {
  public:
    void start(FrameHandler, StateHandler, ErrorHandler) override {}
    void stop() noexcept override {}
    bool send(const canfd_frame& frame, bool) noexcept override {
        if (!full) sent.push_back(frame);
        return !full;
    }
    CanPortCounters counters() const noexcept override { return {}; }
    PortState state() const noexcept override { return PortState::running; }

    std::vector<canfd_frame> sent;
    bool full = false;
};

class GimbalTest : public ::testing::Test {
  protected:
    GimbalState update(Time now) {
        const GimbalState state = gimbal_.update(status_, now);
        EXPECT_GT(gimbal_.next_deadline(), now) << name_of(state);
        return state;
    }
    void report(Time time, std::uint8_t echo, bool in_position) {
        status_.gimbal_time = time;
        status_.gimbal_command_echo = echo;
        status_.in_position = in_position;
        status_.slewing = !in_position;
    }
    double sent(std::size_t i, const char* signal) const {
        const canfd_frame& f = port_.sent.at(i);
        return *proto::decode(*rig_dbc().find("GimbalCommand")->find(signal),
                              std::span(f.data, f.len));
    }

    static constexpr Time kStart = 100 * kSecond;
    RecordingPort port_;
    GimbalSettings settings_;
    Gimbal gimbal_{rig_dbc(), settings_, port_};
    PlatformStatus status_;
};

TEST_F(GimbalTest, FollowsACommandToInPosition) {
    EXPECT_EQ(update(kStart), GimbalState::idle);
    // WHEN a slew is commanded
    gimbal_.slew_to({90, 0.01, -45}, kStart);
    ASSERT_EQ(port_.sent.size(), 1u);
    EXPECT_EQ(port_.sent[0].can_id, 0x200u);
    EXPECT_NEAR(sent(0, "Outer"), 90, 1e-9);
    EXPECT_NEAR(sent(0, "Inner"), 0.01, 1e-9);
    EXPECT_NEAR(sent(0, "Azimuth"), -45, 1e-9);
    EXPECT_EQ(sent(0, "Mode"), 1);
    EXPECT_EQ(sent(0, "Counter"), 1);
    EXPECT_EQ(gimbal_.state(), GimbalState::commanding);
    // THEN it is followed by the platform's own word
    report(kStart + 100 * kMillisecond, 1, false);
    EXPECT_EQ(update(kStart + 100 * kMillisecond), GimbalState::slewing);
    report(kStart + 200 * kMillisecond, 1, true);
    EXPECT_EQ(update(kStart + 200 * kMillisecond), GimbalState::in_position);
    EXPECT_EQ(port_.sent.size(), 1u);
}

TEST_F(GimbalTest, RepeatsACommandUntilItIsEchoed) {
    report(kStart, 0, true);
    gimbal_.slew_to({1, 2, 3}, kStart);
    // GIVEN a platform in position whose status does not know the command yet
    for (Time t = kStart + 50 * kMillisecond; t <= kStart + kSecond; t += 50 * kMillisecond) {
        report(t, 0, true);
        EXPECT_EQ(update(t), GimbalState::commanding);
    }
    // THEN the same command goes out every 200 ms
    EXPECT_EQ(port_.sent.size(), 6u);
    for (std::size_t i = 0; i < port_.sent.size(); ++i) EXPECT_EQ(sent(i, "Counter"), 1);
    // WHEN it is echoed THEN no more
    report(kStart + 1100 * kMillisecond, 1, true);
    EXPECT_EQ(update(kStart + 1100 * kMillisecond), GimbalState::in_position);
    report(kStart + 1500 * kMillisecond, 1, true);
    update(kStart + 1500 * kMillisecond);
    EXPECT_EQ(port_.sent.size(), 6u);
}

TEST_F(GimbalTest, DoesNotTakeAnOldStatusForAnAnswer) {
    // GIVEN a status from before the command that happens to show its counter and "in position"
    report(kStart - kMillisecond, 1, true);
    gimbal_.slew_to({1, 2, 3}, kStart);
    EXPECT_EQ(update(kStart + kMillisecond), GimbalState::commanding);
}

TEST_F(GimbalTest, BeginsWhereThePlatformsCounterStands) {
    // GIVEN a platform that still echoes 255 from an earlier run of the daemon
    report(kStart, 255, true);
    EXPECT_EQ(update(kStart), GimbalState::idle);
    gimbal_.slew_to({1, 2, 3}, kStart);
    EXPECT_EQ(sent(0, "Counter"), 0);
    report(kStart + kMillisecond, 255, true);
    EXPECT_EQ(update(kStart + kMillisecond), GimbalState::commanding);
}

TEST_F(GimbalTest, SaysWhenThePlatformIsSilent) {
    gimbal_.slew_to({1, 2, 3}, kStart);
    EXPECT_EQ(update(kStart), GimbalState::no_status);
    report(kStart + 100 * kMillisecond, 1, false);
    EXPECT_EQ(update(kStart + 100 * kMillisecond), GimbalState::slewing);
    // WHEN the status is 500 ms old THEN it is still believed, and not after that
    EXPECT_EQ(gimbal_.next_deadline(), kStart + 600 * kMillisecond + 1);
    EXPECT_EQ(update(kStart + 600 * kMillisecond), GimbalState::slewing);
    EXPECT_EQ(update(kStart + 600 * kMillisecond + 1), GimbalState::no_status);
    // AND the position it once reported does not count
    report(kStart + 700 * kMillisecond, 1, true);
    EXPECT_EQ(update(kStart + 700 * kMillisecond), GimbalState::in_position);
    EXPECT_EQ(update(kStart + 2 * kSecond), GimbalState::no_status);
}

TEST_F(GimbalTest, TimesOutAndStaysSoUntilTheNextCommand) {
    gimbal_.slew_to({1, 2, 3}, kStart);
    Time t = kStart;
    for (; t < kStart + settings_.slew_timeout; t += 100 * kMillisecond) {
        report(t, 1, false);
        EXPECT_NE(update(t), GimbalState::timed_out);
    }
    report(t, 1, false);
    EXPECT_EQ(update(t), GimbalState::timed_out);
    report(t + kSecond, 1, true);
    EXPECT_EQ(update(t + kSecond), GimbalState::timed_out);
    EXPECT_EQ(gimbal_.next_deadline(), kNever);
    gimbal_.slew_to({1, 2, 3}, t + kSecond);
    report(t + 2 * kSecond, 2, true);
    EXPECT_EQ(update(t + 2 * kSecond), GimbalState::in_position);
}

TEST_F(GimbalTest, HasNoTimeoutOnceThere) {
    gimbal_.slew_to({1, 2, 3}, kStart);
    report(kStart + kSecond, 1, true);
    EXPECT_EQ(update(kStart + kSecond), GimbalState::in_position);
    // WHEN the platform is pushed out of position long after
    report(kStart + 500 * kSecond, 1, false);
    EXPECT_EQ(update(kStart + 500 * kSecond), GimbalState::slewing);
}

TEST_F(GimbalTest, ReleasesThePlatformToDrift) {
    gimbal_.slew_to({10, 20, 30}, kStart);
    report(kStart + kSecond, 1, true);
    update(kStart + kSecond);
    gimbal_.release(kStart + kSecond);
    EXPECT_EQ(sent(1, "Mode"), 0);
    EXPECT_EQ(sent(1, "Counter"), 2);
    EXPECT_EQ(update(kStart + kSecond), GimbalState::commanding);
    report(kStart + 2 * kSecond, 2, false);
    EXPECT_EQ(update(kStart + 2 * kSecond), GimbalState::idle);
    EXPECT_EQ(gimbal_.next_deadline(), kNever);
}

TEST_F(GimbalTest, TriesAgainWhenTheBusIsFull) {
    port_.full = true;
    gimbal_.slew_to({1, 2, 3}, kStart);
    EXPECT_TRUE(port_.sent.empty());
    port_.full = false;
    report(kStart + 200 * kMillisecond, 0, false);
    update(kStart + 200 * kMillisecond);
    EXPECT_EQ(port_.sent.size(), 1u);
}

TEST_F(GimbalTest, SendsAnglesTheWireCanCarry) {
    // GIVEN encoder angles up to 360 deg on signals that end at 327.67 deg
    gimbal_.slew_to({350, 180, 720.5}, kStart);
    EXPECT_NEAR(sent(0, "Outer"), -10, 1e-9);
    EXPECT_NEAR(std::abs(sent(0, "Inner")), 180, 1e-9);
    EXPECT_NEAR(sent(0, "Azimuth"), 0.5, 1e-9);
    // AND none that is no number
    gimbal_.slew_to({std::numeric_limits<double>::quiet_NaN(), 0, 0}, kStart);
    EXPECT_EQ(port_.sent.size(), 1u);
}

TEST(GimbalBinding, NamesWhatTheDbcLacks) {
    RecordingPort port;
    GimbalSettings settings;
    settings.message = "GimbalComand";
    try {
        const Gimbal gimbal(rig_dbc(), settings, port);
        FAIL() << "bound to nothing";
    } catch (const BindingError& error) {
        EXPECT_NE(std::string(error.what()).find("GimbalCommand.Outer"), std::string::npos)
            << error.what();
    }
}

TEST(GimbalBinding, RefusesAnglesInAnotherUnit) {
    RecordingPort port;
    proto::Dbc dbc = rig_dbc();
    const auto at = std::ranges::find(dbc.messages, "GimbalCommand", &proto::Message::name);
    std::ranges::find(at->signals, "Inner", &proto::Signal::name)->unit = "mrad";
    try {
        const Gimbal gimbal(dbc, {}, port);
        FAIL() << "would be commanded in the wrong unit";
    } catch (const BindingError& error) {
        EXPECT_NE(
            std::string(error.what()).find("expected a signal in deg; in the DBC it is in mrad"),
            std::string::npos)
            << error.what();
    }
}

/// In position at the newest command.
GimbalState arrive(Gimbal& gimbal, PlatformStatus& status, std::uint8_t echo, Time now) {
    status.gimbal_time = now;
    status.gimbal_command_echo = echo;
    status.in_position = true;
    status.slewing = false;
    return gimbal.update(status, now);
}

TEST_F(GimbalTest, GoesByTheMiddleOfATravelThatCablesLimit) {
    // GIVEN cables that do not let the azimuth gimbal through its half turn
    settings_.travel_deg[2] = {-175, 175};
    Gimbal gimbal(rig_dbc(), settings_, port_);
    // WHEN it is sent somewhere THEN it goes by the middle: nobody knows where it is
    gimbal.slew_to({10, 0, -170}, kStart);
    EXPECT_NEAR(sent(0, "Outer"), 10, 1e-9);
    EXPECT_NEAR(sent(0, "Azimuth"), 0, 1e-9);
    EXPECT_NE(arrive(gimbal, status_, 1, kStart + kSecond), GimbalState::in_position);
    ASSERT_EQ(port_.sent.size(), 2u);
    EXPECT_NEAR(sent(1, "Azimuth"), -170, 1e-9);
    EXPECT_EQ(arrive(gimbal, status_, 2, kStart + 2 * kSecond), GimbalState::in_position);
    // AND the 20 deg through the cables are 340 deg the other way, by the middle
    gimbal.slew_to({10, 0, 170}, kStart + 3 * kSecond, true);
    EXPECT_NEAR(sent(2, "Azimuth"), 0, 1e-9);
    EXPECT_EQ(sent(2, "Mode"), 1) << "increments are of the last leg";
    EXPECT_NE(arrive(gimbal, status_, 3, kStart + 4 * kSecond), GimbalState::in_position);
    EXPECT_NEAR(sent(3, "Azimuth"), 170, 1e-9);
    EXPECT_EQ(sent(3, "Mode"), 2);
    EXPECT_EQ(arrive(gimbal, status_, 4, kStart + 5 * kSecond), GimbalState::in_position);
    // BUT what is near is gone to at once, until somebody may have turned it
    gimbal.slew_to({10, 0, 20}, kStart + 6 * kSecond);
    EXPECT_NEAR(sent(4, "Azimuth"), 20, 1e-9);
    EXPECT_EQ(arrive(gimbal, status_, 5, kStart + 7 * kSecond), GimbalState::in_position);
    gimbal.forget_position();
    gimbal.slew_to({10, 0, 30}, kStart + 8 * kSecond);
    EXPECT_NEAR(sent(5, "Azimuth"), 0, 1e-9);
}

TEST_F(GimbalTest, ItStaysWhereItIsKnownToStandThoughCablesLimitIt) {
    settings_.travel_deg = {{{-130, 130}, {-360, 360}, {-175, 175}}};
    Gimbal gimbal{rig_dbc(), settings_, port_};
    // GIVEN readings that say where it stands WHEN it is commanded there THEN by no detour
    gimbal.stands_at({120, 10, -160});
    gimbal.slew_to({120, 10, -160}, kStart);
    ASSERT_EQ(port_.sent.size(), 1u);
    EXPECT_NEAR(sent(0, "Outer"), 120, 1e-9);
    EXPECT_NEAR(sent(0, "Azimuth"), -160, 1e-9);
}

TEST_F(GimbalTest, NeverSendsWhatTheTravelDoesNotReach) {
    settings_.travel_deg[0] = {-130, 130};
    Gimbal gimbal(rig_dbc(), settings_, port_);
    gimbal.slew_to({180, 0, 0}, kStart);
    EXPECT_EQ(port_.sent.size(), 0u);
    status_.gimbal_time = kStart + settings_.slew_timeout;
    EXPECT_EQ(gimbal.update(status_, kStart + settings_.slew_timeout), GimbalState::timed_out);
    // 230 deg is -130 deg
    gimbal.slew_to({230, 0, 0}, kStart);
    EXPECT_EQ(port_.sent.size(), 1u);
}

}  // namespace
}  // namespace vibrig::test
