#include <gtest/gtest.h>

#include <array>
#include <cstdint>

#include "proto/dbc.hpp"

namespace vibrig::proto {
namespace {

const Dbc& rig() {
    static const Dbc dbc = parse_dbc(rig_dbc_text(), "rig.dbc");
    return dbc;
}

TEST(RigDbc, IsReadWithoutComplaint) { EXPECT_EQ(rig().messages.size(), 15U); }

TEST(RigDbc, HasTheResolutionOfTwentyBitEncoders) {
    // GIVEN half a turn and one least significant bit on the outer axis, a quarter turn inside
    const Message* message = rig().find("Resolvers");
    ASSERT_NE(message, nullptr);
    EXPECT_EQ(message->id, 0x101U);
    EXPECT_EQ(message->cycle_time_ms, 25U);
    const std::uint64_t word = 0x80001U | (std::uint64_t{0x40000} << 20) | (std::uint64_t{1} << 40);
    std::array<std::uint8_t, 8> payload{};
    for (std::size_t i = 0; i < 8; ++i) payload.at(i) = static_cast<std::uint8_t>(word >> (8 * i));
    // WHEN the signals are decoded THEN they are exact: the scale is a power of two times 360
    EXPECT_EQ(decode(*message->find("Outer"), payload), 180.0 + 360.0 / 1048576.0);
    EXPECT_EQ(decode(*message->find("Inner"), payload), 90.0);
    EXPECT_EQ(decode(*message->find("OuterValid"), payload), 1.0);
    EXPECT_EQ(decode(*message->find("InnerValid"), payload), 0.0);
}

TEST(RigDbc, CarriesAccelerationsOfThirtyTwoG) {
    const Message* message = rig().find(0x110, false);
    ASSERT_NE(message, nullptr);
    std::array<std::uint8_t, 8> payload{};
    ASSERT_TRUE(encode(*message->find("X"), -32.0, payload));
    ASSERT_TRUE(encode(*message->find("Y"), 9.0 / 262144.0, payload));
    EXPECT_EQ(decode(*message->find("X"), payload), -32.0);
    EXPECT_EQ(decode(*message->find("Y"), payload), 9.0 / 262144.0);
    EXPECT_EQ(decode_raw(*message->find("X"), payload), -8388608);
    // AND a saturated accelerometer is out of range, 31 g is not
    EXPECT_TRUE(out_of_range(*message->find("X"), -32.0));
    EXPECT_TRUE(out_of_range(*message->find("X"), 8388607.0 / 262144.0));
    EXPECT_FALSE(out_of_range(*message->find("X"), 31.0));
}

TEST(RigDbc, NamesUnitsValuesAndMultiplexedTemperatures) {
    const Message* temperatures = rig().find("PlatformTemperatures");
    ASSERT_NE(temperatures, nullptr);
    const Signal* gyro = temperatures->find("GyroX");
    ASSERT_NE(gyro, nullptr);
    EXPECT_EQ(gyro->unit, "degC");
    EXPECT_EQ(gyro->multiplex_value, 1U);
    EXPECT_EQ(temperatures->multiplexor()->value_names.at(3), "gyro z");
    EXPECT_EQ(rig().find("GimbalCommand")->find("Mode")->value_names.at(1), "slew");
    EXPECT_FALSE(rig().find("GimbalCommand")->cycle_time_ms.has_value());
    std::array<std::uint8_t, 8> payload{1, 0, 0x10, 0x27};
    EXPECT_TRUE(present(*temperatures, *gyro, payload));
    EXPECT_FALSE(present(*temperatures, *temperatures->find("Case"), payload));
    EXPECT_DOUBLE_EQ(decode(*gyro, payload).value(), 100.0);
}

}  // namespace
}  // namespace vibrig::proto
