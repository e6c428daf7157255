// can.* of a bus that a person turns the gimbals of.
#include "daemon/commission/bus_find.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>

namespace vibrig::commission {
namespace {

using ::testing::HasSubstr;

constexpr const char* kSmallBus = R"(VERSION ""
BU_: Rig Us
BO_ 16 Counter: 2 Rig
 SG_ Count : 0|16@1+ (1,0) [0|65535] "" Us
BO_ 32 Angles: 6 Rig
 SG_ Alpha : 0|16@1+ (0.01,0) [0|360] "deg" Us
 SG_ Beta : 16|16@1+ (0.01,0) [0|360] "deg" Us
 SG_ Gamma : 32|16@1+ (0.01,0) [0|360] "deg" Us
BO_ 48 Forces: 6 Rig
 SG_ P : 0|16@1- (0.0001,0) [-3|3] "g" Us
 SG_ Q : 16|16@1- (0.0001,0) [-3|3] "g" Us
 SG_ R : 32|16@1- (0.0001,0) [-3|3] "g" Us
BO_ 64 Table: 2 Rig
 SG_ S : 0|16@1- (0.0001,0) [-3|3] "g" Us
)";

struct Turned {
    proto::Dbc dbc = proto::parse_dbc(kSmallBus, "small.dbc");
    BusSignals signals{dbc};
    BusList list;
    std::uint16_t count = 65500;
    drivers::Time time = 0;

    static std::array<std::uint8_t, 6> words(double a, double b, double c) {
        std::array<std::uint8_t, 6> bytes{};
        const std::array values{a, b, c};
        for (std::size_t i = 0; i < 3; ++i) {
            const auto raw = static_cast<std::uint16_t>(static_cast<int>(std::lround(values[i])));
            bytes[2 * i] = static_cast<std::uint8_t>(raw & 0xff);
            bytes[2 * i + 1] = static_cast<std::uint8_t>(raw >> 8);
        }
        return bytes;
    }
    void frames(int n, int gimbal, double hz) {
        for (int i = 0; i < n; ++i) {
            ++count;
            time += static_cast<drivers::Time>(1e9 / hz);
            const double turn = gimbal < 0 ? 0 : 20 * std::sin(M_PI * i / n);
            const double flicker = i % 2 == 0 ? 0.01 : 0;
            const std::array<double, 3> angle{90 + flicker + (gimbal == 0 ? turn : 0),
                                              10 + flicker + (gimbal == 1 ? turn : 0),
                                              200 + flicker + (gimbal == 2 ? turn : 0)};
            const double lean = turn * M_PI / 180;
            const auto add = [&](std::uint32_t id, std::span<const std::uint8_t> data) {
                signals.add(id, false, data);
                list.add(id, false, data, time);
            };
            const std::array<std::uint8_t, 2> counter{static_cast<std::uint8_t>(count & 0xff),
                                                      static_cast<std::uint8_t>(count >> 8)};
            add(16, counter);
            add(32, words(100 * angle[0], 100 * angle[1], 100 * angle[2]));
            // About the third axis, or about the second.
            const double c = std::cos(lean), s = std::sin(lean);
            const std::array<double, 3> force =
                gimbal == 1 ? std::array{0.6 * c - 0.8 * s, 0.6 * s + 0.8 * c, 0.0}
                            : std::array{0.6 * c, 0.8, 0.6 * s};
            add(48, words(1e4 * force[0] + (i % 3), 1e4 * force[1], 1e4 * force[2] + (i % 2)));
            const std::array<std::uint8_t, 2> still{static_cast<std::uint8_t>(i % 2), 0};
            add(64, still);
        }
    }
    void turn(int gimbal, double hz = 40) {
        frames(200, -1, hz);
        signals.turned();
        list.turned();
        frames(200, gimbal, hz);
    }
};

Finding find(double hz, double configured_hz, std::array<int, 3> turned = {2, 0, 1}) {
    BusFinder finder("/etc/rig.dbc", configured_hz);
    for (std::size_t g = 0; g < 3; ++g) {
        Turned bus;
        bus.turn(turned[g], hz);
        static_cast<void>(finder.turned(g, bus.signals));
        finder.listen(bus.dbc, bus.signals, bus.list);
    }
    return finder.finding();
}

std::string value_of(const Finding& finding, const std::string& key) {
    for (const auto& one : finding.keys)
        if (one.key == key) return one.value;
    return "nothing";
}

TEST(BusFinder, NamesAnglesAccelerometersCounterAndRate) {
    const auto found = find(40.1, 0);
    ASSERT_EQ(found.outcome, Finding::Outcome::decided) << found.why;
    EXPECT_EQ(value_of(found, "can.dbc"), "\"/etc/rig.dbc\"");
    EXPECT_EQ(value_of(found, "can.signals.outer"), "\"Angles.Gamma\"");
    EXPECT_EQ(value_of(found, "can.signals.inner"), "\"Angles.Alpha\"");
    EXPECT_EQ(value_of(found, "can.signals.azimuth"), "\"Angles.Beta\"");
    EXPECT_EQ(value_of(found, "can.signals.accel_x"), "\"Forces.P\"");
    EXPECT_EQ(value_of(found, "can.signals.accel_z"), "\"Forces.R\"");
    EXPECT_EQ(value_of(found, "can.signals.sync_count"), "\"Counter.Count\"");
    EXPECT_EQ(value_of(found, "can.sample_rate_hz"), "40.1");
    const auto toml = to_toml(found, false);
    EXPECT_THAT(toml, HasSubstr("[can.signals]\n"));
    EXPECT_THAT(toml, HasSubstr("40.1 frames/s with Counter.Count by the kernel's stamps"));
}

TEST(BusFinder, ARateThatIsNotTheConfiguredOneIsAnError) {
    EXPECT_EQ(value_of(find(40.1, 40), "can.sample_rate_hz"), "40") << "within 1 %";
    const auto lies = find(40.6, 40);
    EXPECT_EQ(lies.outcome, Finding::Outcome::refused);
    EXPECT_THAT(lies.why, HasSubstr("40.6 samples/s measured"));
    EXPECT_TRUE(lies.keys.empty());
}

TEST(BusFinder, WhatFollowsNoGimbalOrTwoIsNotWritten) {
    const auto still = find(40, 0, {2, -1, 1});
    EXPECT_EQ(still.outcome, Finding::Outcome::undecided);
    EXPECT_THAT(still.why, HasSubstr("the inner gimbal's angle is not known"));
    EXPECT_TRUE(still.keys.empty());
    BusFinder finder("/etc/rig.dbc", 0);
    Turned once, again;
    once.turn(0);
    again.turn(0);
    EXPECT_EQ(finder.turned(0, once.signals), "");
    EXPECT_THAT(finder.turned(1, again.signals),
                HasSubstr("INNER: Angles.Alpha follows it, which follows the OUTER gimbal, too"));
}

}  // namespace
}  // namespace vibrig::commission
