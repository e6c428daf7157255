#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>

#include "proto/dbc.hpp"

namespace vibrig::proto {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

Signal make(unsigned start, unsigned length, ByteOrder order, bool is_signed = false) {
    Signal signal;
    signal.name = "S";
    signal.start_bit = static_cast<std::uint16_t>(start);
    signal.length = static_cast<std::uint16_t>(length);
    signal.order = order;
    signal.is_signed = is_signed;
    return signal;
}

/// A bit of the payload by the DBC's number.
unsigned bit_of(std::span<const std::uint8_t> payload, unsigned bit) {
    const unsigned byte = payload[bit / 8];
    return (byte >> (bit % 8)) & 1U;
}

/// The bit after this one on the way from the most to the least significant, big endian: right
/// inside a byte, then the left bit of the next.
unsigned after_motorola(unsigned bit) { return bit % 8 == 0 ? bit + 15 : bit - 1; }

std::uint64_t raw_bit_by_bit(const Signal& signal, std::span<const std::uint8_t> payload) {
    std::uint64_t raw = 0;
    unsigned bit = signal.start_bit;
    for (unsigned i = 0; i < signal.length; ++i) {
        if (signal.order == ByteOrder::little) {
            raw |= std::uint64_t{bit_of(payload, bit)} << i;
            ++bit;
        } else {
            raw = (raw << 1) | bit_of(payload, bit);
            bit = after_motorola(bit);
        }
    }
    return raw;
}

TEST(SignalCodec, ReadsIntelBitsAcrossBytes) {
    const std::array<std::uint8_t, 3> payload{0x12, 0x34, 0x56};
    EXPECT_EQ(decode_raw(make(0, 16, ByteOrder::little), payload), 0x3412);
    EXPECT_EQ(decode_raw(make(4, 12, ByteOrder::little), payload), 0x341);
    EXPECT_EQ(decode_raw(make(4, 16, ByteOrder::little), payload), 0x6341);
    EXPECT_EQ(decode_raw(make(9, 1, ByteOrder::little), payload), 0);
    EXPECT_EQ(decode_raw(make(10, 1, ByteOrder::little), payload), 1);
}

TEST(SignalCodec, ReadsMotorolaBitsFromTheMostSignificant) {
    const std::array<std::uint8_t, 3> payload{0x12, 0x34, 0x56};
    EXPECT_EQ(decode_raw(make(7, 16, ByteOrder::big), payload), 0x1234);
    EXPECT_EQ(decode_raw(make(3, 12, ByteOrder::big), payload), 0x234);
    EXPECT_EQ(decode_raw(make(3, 8, ByteOrder::big), payload), 0x23);
    EXPECT_EQ(decode_raw(make(0, 9, ByteOrder::big), payload), 0x034);
    EXPECT_EQ(decode_raw(make(15, 16, ByteOrder::big), payload), 0x3456);
    EXPECT_EQ(decode_raw(make(12, 1, ByteOrder::big), payload), 1);
}

TEST(SignalCodec, ExtendsTheSign) {
    const std::array<std::uint8_t, 8> ones{0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff};
    const std::array<std::uint8_t, 2> lowest{0x00, 0x08};
    EXPECT_EQ(decode_raw(make(3, 7, ByteOrder::little, true), ones), -1);
    EXPECT_EQ(decode_raw(make(0, 64, ByteOrder::little, true), ones), -1);
    EXPECT_EQ(decode_raw(make(7, 64, ByteOrder::big, true), ones), -1);
    EXPECT_EQ(decode_raw(make(0, 1, ByteOrder::little, true), ones), -1);
    EXPECT_EQ(decode_raw(make(0, 12, ByteOrder::little, true), lowest), -2048);
    EXPECT_EQ(decode_raw(make(0, 12, ByteOrder::little, false), lowest), 2048);
}

TEST(SignalCodec, KeepsUnsignedValuesOf64Bits) {
    const std::array<std::uint8_t, 8> payload{0, 0, 0, 0, 0, 0, 0, 0x80};
    EXPECT_EQ(decode(make(0, 64, ByteOrder::little), payload), 9223372036854775808.0);
    EXPECT_EQ(decode(make(0, 64, ByteOrder::little, true), payload), -9223372036854775808.0);
    EXPECT_EQ(decode_raw(make(0, 64, ByteOrder::little), payload),
              std::numeric_limits<std::int64_t>::min());
}

TEST(SignalCodec, AgreesWithAWalkBitByBitForEverySize) {
    // GIVEN random signals in payloads of 1 to 64 bytes
    const unsigned seed = 5;
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    std::mt19937_64 random(seed);
    const auto pick = [&](unsigned low, unsigned high) {
        return std::uniform_int_distribution<unsigned>(low, high)(random);
    };
    for (int i = 0; i < 50000; ++i) {
        std::array<std::uint8_t, 64> bytes{};
        for (auto& byte : bytes) byte = static_cast<std::uint8_t>(pick(0, 255));
        const unsigned size = pick(1, 64);
        const std::span<std::uint8_t> payload(bytes.data(), size);
        const unsigned length = pick(1, std::min(64U, size * 8));
        const unsigned first = pick(0, size * 8 - length);
        const bool big = pick(0, 1) == 1;
        const unsigned start = big ? first / 8 * 8 + 7 - first % 8 : first;
        const Signal signal = make(start, length, big ? ByteOrder::big : ByteOrder::little);
        SCOPED_TRACE(testing::Message() << start << '|' << length << '@' << (big ? 0 : 1));
        // WHEN they are decoded THEN the bits are those of the definition
        const std::uint64_t expected = raw_bit_by_bit(signal, payload);
        ASSERT_EQ(decode_raw(signal, payload), std::bit_cast<std::int64_t>(expected));
        // WHEN others are written THEN these are read back and no other bit has changed
        const auto before = bytes;
        const std::uint64_t value = random() >> (64 - length);
        ASSERT_TRUE(encode_raw(signal, value, payload));
        ASSERT_EQ(raw_bit_by_bit(signal, payload), value);
        ASSERT_TRUE(encode_raw(signal, expected, payload));
        ASSERT_EQ(bytes, before);
        // WHEN the payload lacks the byte of the last bit THEN there is no value
        const unsigned needed = (first + length + 7) / 8;
        const std::span<std::uint8_t> cut(bytes.data(), needed - 1);
        ASSERT_FALSE(decode_raw(signal, cut).has_value());
        ASSERT_FALSE(decode(signal, cut).has_value());
        ASSERT_FALSE(encode_raw(signal, value, cut));
        ASSERT_FALSE(encode(signal, 0, cut));
        ASSERT_TRUE(decode_raw(signal, std::span(bytes.data(), needed)).has_value());
        ASSERT_EQ(bytes, before);
    }
}

TEST(SignalCodec, IgnoresRawBitsAboveTheSignal) {
    std::array<std::uint8_t, 2> payload{};
    ASSERT_TRUE(encode_raw(make(4, 4, ByteOrder::little), 0xfff, payload));
    EXPECT_EQ(payload, (std::array<std::uint8_t, 2>{0xf0, 0x00}));
}

TEST(SignalCodec, GivesBackEveryPhysicalValueWithinHalfAStep) {
    const unsigned seed = 6;
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    std::mt19937_64 random(seed);
    Signal signal = make(7, 24, ByteOrder::big, true);
    signal.scale = -3.814697265625e-06;
    signal.offset = 1.5;
    std::array<std::uint8_t, 3> payload{};
    std::uniform_real_distribution<double> values(-30, 30);
    for (int i = 0; i < 1000; ++i) {
        const double value = values(random);
        ASSERT_TRUE(encode(signal, value, payload));
        ASSERT_NEAR(decode(signal, payload).value(), value, -signal.scale / 2 * (1 + 1e-9));
    }
}

TEST(SignalCodec, ClampsToWhatTheBitsHold) {
    std::array<std::uint8_t, 8> payload{};
    const auto coded = [&](const Signal& signal, double value) {
        EXPECT_TRUE(encode(signal, value, payload)) << value;
        return decode_raw(signal, payload);
    };
    Signal byte = make(0, 8, ByteOrder::little);
    EXPECT_EQ(coded(byte, 256), 255);
    EXPECT_EQ(coded(byte, -0.6), 0);
    EXPECT_EQ(coded(byte, 254.5), 255);
    EXPECT_EQ(coded(byte, 1e300), 255);
    EXPECT_EQ(coded(byte, -1e300), 0);
    byte.is_signed = true;
    EXPECT_EQ(coded(byte, 127.6), 127);
    EXPECT_EQ(coded(byte, -128.6), -128);
    EXPECT_EQ(coded(byte, -1e300), -128);
    byte.scale = 1e-300;  // the quotient overflows to infinity
    EXPECT_EQ(coded(byte, 1e300), 127);
    const Signal wide = make(0, 64, ByteOrder::little);
    EXPECT_EQ(coded(wide, 2e19), -1);  // all ones
    EXPECT_EQ(coded(wide, 18446744073709549568.0), -2048);
    const Signal signed_wide = make(0, 64, ByteOrder::little, true);
    EXPECT_EQ(coded(signed_wide, 1e19), std::numeric_limits<std::int64_t>::max());
    EXPECT_EQ(coded(signed_wide, -1e19), std::numeric_limits<std::int64_t>::min());
    const Signal flag = make(63, 1, ByteOrder::little, true);
    EXPECT_EQ(coded(flag, 5), 0);
    EXPECT_EQ(coded(flag, -5), -1);
}

TEST(SignalCodec, RefusesValuesThatAreNotFinite) {
    std::array<std::uint8_t, 8> payload{1, 2, 3, 4, 5, 6, 7, 8};
    const auto before = payload;
    Signal signal = make(0, 32, ByteOrder::little);
    for (const ValueType type : {ValueType::integer, ValueType::float32}) {
        signal.type = type;
        EXPECT_FALSE(encode(signal, kNan, payload));
        EXPECT_FALSE(encode(signal, kInfinity, payload));
        EXPECT_FALSE(encode(signal, -kInfinity, payload));
    }
    EXPECT_EQ(payload, before);
}

TEST(SignalCodec, CodesFloatsOfBothSizesAndOrders) {
    std::array<std::uint8_t, 8> payload{};
    Signal single = make(7, 32, ByteOrder::big, true);
    single.type = ValueType::float32;
    ASSERT_TRUE(encode(single, -1.5, payload));
    EXPECT_EQ(payload, (std::array<std::uint8_t, 8>{0xbf, 0xc0, 0, 0, 0, 0, 0, 0}));
    EXPECT_EQ(decode(single, payload), -1.5);
    ASSERT_TRUE(encode(single, 1e300, payload));
    EXPECT_EQ(decode(single, payload), static_cast<double>(std::numeric_limits<float>::max()));
    Signal real = make(0, 64, ByteOrder::little, true);
    real.type = ValueType::float64;
    real.scale = 2;
    real.offset = 1;
    ASSERT_TRUE(encode(real, 1.0 + 2 * 0.1, payload));
    EXPECT_DOUBLE_EQ(decode(real, payload).value(), 1.2);
    payload = {0, 0, 0, 0, 0, 0, 0xf8, 0x7f};
    EXPECT_TRUE(std::isnan(decode(real, payload).value()));
    EXPECT_TRUE(out_of_range(real, decode(real, payload).value()));
}

TEST(SignalCodec, SurvivesSignalsThatNoFileCanDeclare) {
    std::array<std::uint8_t, 8> payload{};
    for (const unsigned length : {0U, 65U, 1000U, 65535U}) {
        for (const unsigned start : {0U, 7U, 65535U}) {
            for (const ByteOrder order : {ByteOrder::little, ByteOrder::big}) {
                const Signal signal = make(start, length, order);
                EXPECT_FALSE(decode(signal, payload).has_value());
                EXPECT_FALSE(encode(signal, 1, payload));
                EXPECT_FALSE(encode_raw(signal, 1, payload));
            }
        }
    }
    EXPECT_FALSE(decode(make(0, 8, ByteOrder::little), {}).has_value());
}

TEST(SignalCodec, KnowsRangesAndTheirAbsence) {
    Signal signal = make(0, 8, ByteOrder::little);
    EXPECT_FALSE(out_of_range(signal, 1e9));  // 0 to 0 means that none is declared
    EXPECT_TRUE(out_of_range(signal, kNan));
    EXPECT_TRUE(out_of_range(signal, kInfinity));
    signal.minimum = -1;
    signal.maximum = 2;
    EXPECT_FALSE(out_of_range(signal, -1));
    EXPECT_FALSE(out_of_range(signal, 2));
    EXPECT_TRUE(out_of_range(signal, 2.001));
    EXPECT_TRUE(out_of_range(signal, -1.001));
}

TEST(SignalCodec, FindsMultiplexedSignalsByTheValueInForce) {
    Message message;
    message.signals = {make(0, 8, ByteOrder::little), make(8, 8, ByteOrder::little),
                       make(8, 8, ByteOrder::little), make(16, 8, ByteOrder::little)};
    message.signals[0].is_multiplexor = true;
    message.signals[1].multiplex_value = 3;
    message.signals[2].multiplex_value = 10;
    message.signals[2].multiplex_last = 12;
    const auto seen = [&](std::uint8_t value, std::size_t index) {
        const std::array<std::uint8_t, 3> payload{value, 0, 0};
        return present(message, message.signals[index], payload);
    };
    EXPECT_TRUE(seen(3, 1));
    EXPECT_FALSE(seen(4, 1));
    EXPECT_FALSE(seen(9, 2));
    EXPECT_TRUE(seen(10, 2));
    EXPECT_TRUE(seen(12, 2));
    EXPECT_FALSE(seen(13, 2));
    EXPECT_TRUE(seen(77, 0));
    EXPECT_TRUE(seen(77, 3));
    EXPECT_FALSE(present(message, message.signals[1], {}));  // the multiplexor is not there
    message.signals[0].is_multiplexor = false;
    EXPECT_FALSE(seen(3, 1));
}

}  // namespace
}  // namespace vibrig::proto
