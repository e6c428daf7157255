#include "daemon/commission/bus_signals.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

#include "tests/plant/random.hpp"

namespace vibrig::commission {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double kRad = std::numbers::pi / 180;

/// A bus with the built-in DBC's messages: at rest, then `turn` says the angles at each frame.
struct Bus {
    proto::Dbc dbc = proto::parse_dbc(proto::rig_dbc_text(), "rig.dbc");
    BusSignals signals{dbc};
    plant::Random random{5, 1};

    void send(const char* name, const std::map<std::string, double>& values) {
        const proto::Message* message = dbc.find(std::string_view(name));
        std::array<std::uint8_t, 8> data{};
        for (const auto& [signal, value] : values)
            EXPECT_TRUE(proto::encode(*message->find(signal), value, data)) << signal;
        signals.add(message->id, message->extended, std::span(data).first(message->size));
    }
    /// Outer, inner and azimuth readings, deg; gravity follows outer and inner.
    void frame(int n, double outer, double inner, double azimuth, double kick_g = 0) {
        const auto noisy = [this](double deg) {
            return std::fmod(deg + 5 / 3600.0 * random.normal() + 720, 360.0);
        };
        const auto g = [this](double value) { return value + 1e-4 * random.normal(); };
        send("Sync", {{"SyncCount", n}});
        send("Resolvers", {{"Outer", noisy(outer)}, {"Inner", noisy(inner)}, {"OuterValid", 1}});
        send("ResolverAzimuth", {{"Azimuth", noisy(azimuth)}, {"AzimuthValid", 1}});
        send("AccelerometersXY",
             {{"X", g(std::sin(inner * kRad))},
              {"Y", g(std::cos(outer * kRad) * std::cos(inner * kRad) + kick_g)}});
        send("AccelerometerZ", {{"Z", g(std::sin(outer * kRad) * std::cos(inner * kRad))}});
        send("TableAccelerometer", {{"Axial", g(0)}});
    }
    void run(const std::function<void(int, double)>& turn) {
        for (int n = 0; n < 200; ++n) frame(n, 12, 3, 359.9);
        signals.turned();
        for (int n = 0; n < 200; ++n) turn(200 + n, 20 * std::sin(std::numbers::pi * n / 199.0));
    }
};

TEST(BusSignals, TheAngleThatIsTurnedFollowsAndAccelerometersAreRecognisedByTheirNorm) {
    Bus bus;
    bus.run([&bus](int n, double by) { bus.frame(n, 12 + by, 3, 359.9); });
    EXPECT_EQ(bus.signals.winner(), "Resolvers.Outer");
    EXPECT_EQ(bus.signals.answers().size(), 1U);
    std::map<std::string, BusSignals::Signal> of;
    for (const auto& s : bus.signals.signals()) of[s.name] = s;
    for (const char* name : {"AccelerometersXY.X", "AccelerometersXY.Y", "AccelerometerZ.Z"})
        EXPECT_EQ(of[name].kind, BusSignals::Kind::accelerometer) << name;
    // 20 deg over 5''; a sample's noise of 5'' from 400 differences is known to 5 percent or so
    EXPECT_NEAR(of["Resolvers.Outer"].score(), 20 * 3600 / 5.0, 0.25 * 20 * 3600 / 5.0);
    EXPECT_EQ(of["Sync.SyncCount"].kind, BusSignals::Kind::counter);
    const auto json = json_of(bus.signals, true);
    EXPECT_EQ(json["outcome"], "decided");
    EXPECT_EQ(json["follows"], "Resolvers.Outer");
    EXPECT_THAT(json["counters"], ElementsAre("Sync.SyncCount"));
    // A valid bit that was never seen to change proves nothing.
    EXPECT_THAT(json["unproven"], Contains("Resolvers.OuterValid"));
    EXPECT_THAT(json["missing"], Contains("GyroIncrements"));
    EXPECT_THAT(table_of(bus.signals, true), HasSubstr("Resolvers.Outer follows the gimbal"));
}

TEST(BusSignals, AGimbalThatShakesThePlatformAsItStartsAndStopsIsFoundAllTheSame) {
    Bus bus;
    bus.run([&bus](int n, double by) {
        const int of_turn = n - 200;  // of 200: a third of a second at either end
        const bool shaken = of_turn < 8 || of_turn >= 192;
        bus.frame(n, 12 + by, 3, 359.9, shaken ? (n % 2 == 0 ? 0.2 : -0.2) : 0);
    });
    EXPECT_EQ(bus.signals.winner(), "Resolvers.Outer");
}

TEST(BusSignals, AnAngleThatPassesItsTurnGoesOn) {
    Bus bus;
    bus.run([&bus](int n, double by) { bus.frame(n, 12, 3, 359.9 + by); });
    EXPECT_EQ(bus.signals.winner(), "ResolverAzimuth.Azimuth");
    EXPECT_NEAR(bus.signals.answers().at(0).turned_range, 20, 0.1);
}

TEST(BusSignals, TwoThatMoveTogetherAreBothShown) {
    Bus bus;
    bus.run([&bus](int n, double by) { bus.frame(n, 12 + by, 3, 359.9 + by / 2); });
    EXPECT_EQ(bus.signals.winner(), std::nullopt);
    EXPECT_EQ(json_of(bus.signals, true)["outcome"], "undecided");
    EXPECT_THAT(table_of(bus.signals, true), HasSubstr("UNDECIDED: Resolvers.Outer ("));
}

TEST(BusSignals, NobodyTurnedAndStrangersAreSaid) {
    Bus bus;
    bus.signals.add(0x7a5, false, std::array<std::uint8_t, 2>{1, 2});
    bus.run([&bus](int n, double) { bus.frame(n, 12, 3, 359.9); });
    EXPECT_THAT(table_of(bus.signals, true), HasSubstr("no value answers the turn"));
    EXPECT_THAT(bus.signals.unknown(), ElementsAre("7a5"));
}

}  // namespace
}  // namespace vibrig::commission
