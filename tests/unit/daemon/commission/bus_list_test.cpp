#include "daemon/commission/bus_list.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vibrig::commission {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr drivers::Time kFrame = 25 * drivers::kMillisecond;

TEST(BusList, SaysHowOftenAMessageComesAndWhichOfItsBytesChange) {
    BusList bus;
    drivers::Time time = drivers::kSecond;
    for (int n = 0; n < 300; ++n) {
        // GIVEN a counter that wraps, a bit of noise, one byte that stands still; late by 1 ms
        // every other time
        const std::array<std::uint8_t, 4> data{static_cast<std::uint8_t>(n),
                                               static_cast<std::uint8_t>(n % 3 == 0 ? 1 : 2), 7,
                                               static_cast<std::uint8_t>(n < 200 ? 40 : n - 160)};
        // WHEN it is turned from the 200th on THEN the fourth byte changes
        if (n == 200) bus.turned();
        bus.add(0x123, false, data, time + (n % 2) * drivers::kMillisecond);
        time += kFrame;
    }
    bus.add(0x123, true, std::array<std::uint8_t, 1>{9}, time);
    const auto all = bus.messages();
    ASSERT_EQ(all.size(), 2U);
    EXPECT_EQ(all[0].frames, 300U);
    EXPECT_NEAR(all[0].period_ms, 25, 0.01);
    EXPECT_NEAR(all[0].jitter_ms, 1, 0.01);
    EXPECT_THAT(all[0].at_rest, ElementsAre(0, 1));
    EXPECT_THAT(all[0].counters, ElementsAre(0));
    EXPECT_THAT(all[0].turned_only, ElementsAre(3));
    EXPECT_TRUE(all[1].extended);
    EXPECT_EQ(all[1].period_ms, 0);
    EXPECT_THAT(all[1].at_rest, IsEmpty());
    EXPECT_THAT(table_of(bus), HasSubstr("123          300      25.00       1.00      4  at rest "
                                         "0-1, counts 0, turned 3 (99 %)\n"));
    // AND how often: the counter always, the noise in two of three frames
    ASSERT_EQ(all[0].flips.size(), 3U);
    EXPECT_EQ(all[0].flips[0].at_rest, 1);
    EXPECT_NEAR(all[0].flips[1].at_rest, 2.0 / 3, 0.01);
    EXPECT_EQ(all[0].flips[2].at_rest, 0);
    EXPECT_NEAR(all[0].flips[2].turned, 0.99, 1e-9);
    EXPECT_EQ(json_of(bus)["messages"][0]["flips"][2]["byte"], 3);
    EXPECT_THAT(table_of(bus), HasSubstr("00000123"));
    EXPECT_EQ(json_of(bus)["messages"][0]["turned"], (std::vector<int>{3}));
}

TEST(BusList, AMessageWhoseLengthChangesIsReportedByBoth) {
    BusList bus;
    for (int n = 0; n < 20; ++n)
        bus.add(5, false,
                n % 2 == 0 ? std::vector<std::uint8_t>{1, 2, 3} : std::vector<std::uint8_t>{1, 4},
                n * kFrame);
    const auto all = bus.messages();
    EXPECT_EQ(all[0].shortest, 2U);
    EXPECT_EQ(all[0].longest, 3U);
    EXPECT_THAT(all[0].at_rest, ElementsAre(1));
    EXPECT_THAT(table_of(bus), HasSubstr("    2-3  at rest 1\n"));
}

}  // namespace
}  // namespace vibrig::commission
