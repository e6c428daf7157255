#include "proto/register_map.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace vibrig::proto {
namespace {

Register make(RegisterType type, WordOrder order = WordOrder::big, double scale = 1) {
    Register reg;
    reg.type = type;
    reg.order = order;
    reg.scale = scale;
    return reg;
}

using Words = std::array<std::uint16_t, 2>;

TEST(RegisterMap, HoldsTheFrequencyInMillihertzHighWordFirst) {
    const ShakerRegisters map;
    Words words{};
    ASSERT_TRUE(encode(map.frequency, 100.5, words));
    EXPECT_EQ(words, (Words{1, 100500 - 65536}));
    EXPECT_DOUBLE_EQ(decode(map.frequency, words), 100.5);
    ASSERT_TRUE(encode(map.amplitude, 9.0, words));
    EXPECT_EQ(words, (Words{1, 90000 - 65536}));
}

TEST(RegisterMap, SwapsWordsWhereTheDeviceDoes) {
    Words words{};
    ASSERT_TRUE(encode(make(RegisterType::u32, WordOrder::little), 0x12345678, words));
    EXPECT_EQ(words, (Words{0x5678, 0x1234}));
    ASSERT_TRUE(encode(make(RegisterType::i32), -2, words));
    EXPECT_EQ(words, (Words{0xffff, 0xfffe}));
    EXPECT_EQ(decode(make(RegisterType::i32), words), -2);
    ASSERT_TRUE(encode(make(RegisterType::f32, WordOrder::little), -1.5, words));
    EXPECT_EQ(words, (Words{0x0000, 0xbfc0}));
    EXPECT_EQ(decode(make(RegisterType::f32, WordOrder::little), words), -1.5);
}

TEST(RegisterMap, RefusesWhatTheTypeDoesNotHoldAndWritesNothing) {
    struct Case {
        RegisterType type;
        double lowest, highest;
    };
    for (const Case& c : {Case{RegisterType::u16, 0, 65535}, Case{RegisterType::i16, -32768, 32767},
                          Case{RegisterType::u32, 0, 4294967295},
                          Case{RegisterType::i32, -2147483648, 2147483647}}) {
        const Register reg = make(c.type, WordOrder::big, 0.5);
        Words words{7, 8};
        for (const double value :
             {c.lowest * 0.5 - 0.5, c.highest * 0.5 + 0.5, 1e300, -1e300,
              std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
            EXPECT_FALSE(encode(reg, value, words)) << value;
            EXPECT_EQ(words, (Words{7, 8}));
        }
        for (const double value : {c.lowest * 0.5, c.highest * 0.5}) {
            ASSERT_TRUE(encode(reg, value, words));
            EXPECT_EQ(decode(reg, words), value);
        }
    }
    Words words{7, 8};
    EXPECT_FALSE(encode(make(RegisterType::f32), 1e39, words));
    EXPECT_FALSE(encode(make(RegisterType::u16, WordOrder::big, 0), 0, words));
    EXPECT_FALSE(encode(make(RegisterType::f32, WordOrder::big, 0), 0, words));
    EXPECT_EQ(words, (Words{7, 8}));
}

TEST(RegisterMap, RoundsToTheNearestRawValue) {
    const Register reg = make(RegisterType::u16, WordOrder::big, 1e-2);
    std::array<std::uint16_t, 1> word{};
    ASSERT_TRUE(encode(reg, 0.296, word));
    EXPECT_EQ(word[0], 30);
}

TEST(RegisterMap, MasksBitsAndLeavesTheOthers) {
    Register reg = make(RegisterType::bits);
    reg.mask = 0x0006;
    std::array<std::uint16_t, 1> word{0x8001};
    EXPECT_EQ(decode(reg, word), 0);
    ASSERT_TRUE(encode(reg, 1, word));
    EXPECT_EQ(word[0], 0x8007);
    EXPECT_EQ(decode(reg, word), 1);
    ASSERT_TRUE(encode(reg, 0, word));
    EXPECT_EQ(word[0], 0x8001);
    EXPECT_FALSE(encode(reg, 2, word));
    word[0] = 0x0004;
    EXPECT_EQ(decode(reg, word), 1);
}

TEST(RegisterMap, GivesNoValueForTooFewWords) {
    std::array<std::uint16_t, 1> word{5};
    EXPECT_EQ(make(RegisterType::u32).words(), 2U);
    EXPECT_EQ(make(RegisterType::bits).words(), 1U);
    EXPECT_TRUE(std::isnan(decode(make(RegisterType::u32), word)));
    EXPECT_TRUE(std::isnan(decode(make(RegisterType::u16), {})));
    EXPECT_FALSE(encode(make(RegisterType::f32), 1, word));
    EXPECT_EQ(word[0], 5);
}

}  // namespace
}  // namespace vibrig::proto
