#include "daemon/record/dwells_csv.hpp"
#include "tests/unit/support/temporary_folder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <string>

namespace vibrig::record {
namespace {

constexpr std::int64_t kOffset_ns = 1'700'000'000'000'000'000;

class DwellsCsv : public testing::Test {
  protected:
    [[nodiscard]] Campaign read(const std::string& lines) const {
        std::ofstream(folder_ / "dwells.csv") << kDwellsHeader << "\n" << lines;
        Campaign campaign;
        read_dwells((folder_ / "dwells.csv").string(), campaign);
        return campaign;
    }

    TemporaryFolder folder_;
};

/// Every field another value.
Order full_order() {
    Order order;
    order.run = 2;
    order.position = 3;
    order.table_g = 4.5;
    order.from = 5'000'001'000;
    order.to = 6'500'000'000;
    order.zero_g = {7e-3, -8e-3, 9e-3};
    order.level_sigma_g = 1e-4;
    order.noise = {1.1, {1.2, 1.3, 1.4}};
    order.begin_s = 1.5;
    order.power_lost = true;
    order.frequency_hz = 17.25;
    order.held_out = true;
    order.random = {2.1, 2.2, 2.3, 2.4, 19, -2};
    order.sweep = {25.5, 26.5, 27.5};
    return order;
}

TEST_F(DwellsCsv, AnOrderComesBackAsItWasWritten) {
    const Order was = full_order();
    const std::string line = order_line(was, kOffset_ns);
    EXPECT_EQ(line,
              "2,3,4.5,1700000005.000001,1700000006.500000,,1700000000000000,0.007,-0.008,0.009,"
              "0.0001,1.1,1.2,1.3,1.4,1.5,1,17.25,1,19,-2,2.1,2.2,2.3,2.4,25.5,26.5,27.5\n");
    const Order is = read(line).orders.at(0);
    EXPECT_EQ(is.from, was.from);
    EXPECT_EQ(is.to, was.to);
    EXPECT_EQ(is.random.profile, 19);
    EXPECT_EQ(is.sweep, was.sweep);
    EXPECT_EQ(order_line(is, kOffset_ns), line);
}

TEST_F(DwellsCsv, ACancelledOneHasOnlyItsTime) {
    Order was = full_order();
    was.cancel = true;
    was.announced = 5'250'000'000;
    was.begin_s = std::numeric_limits<double>::quiet_NaN();
    const std::string line = order_line(was, kOffset_ns);
    EXPECT_THAT(line, testing::StartsWith("2,3,4.5,,,1700000005.250000,1700000000000000,"));
    const Order is = read(line).orders.at(0);
    EXPECT_TRUE(is.cancel);
    EXPECT_EQ(is.announced, was.announced);
    EXPECT_TRUE(std::isnan(is.begin_s));
}

TEST_F(DwellsCsv, OlderFilesEndEarlier) {
    std::string line = order_line(full_order(), kOffset_ns);
    for (const int commas : {24, 18, 16, 15, 14}) {
        while (std::ranges::count(line, ',') > commas) line.erase(line.rfind(','));
        const Order is = read(line + "\n").orders.at(0);
        EXPECT_EQ(is.noise.gyro_random_walk_deg_per_rt_h[2], 1.4) << commas;
        EXPECT_EQ(is.power_lost, commas >= 16);
        EXPECT_EQ(is.held_out, commas >= 18);
        EXPECT_EQ(is.random.profile, commas >= 24 ? 19 : 0);
        EXPECT_FALSE(is.sweep.any());
    }
}

TEST_F(DwellsCsv, WhatIsNoNumberIsRefused) {
    const std::string good = order_line(full_order(), kOffset_ns);
    for (const std::size_t field : {0U, 1U, 2U, 6U, 7U, 14U, 15U, 16U, 17U, 18U, 19U, 24U, 27U}) {
        std::string line = good;
        std::size_t begin = 0;
        for (std::size_t i = 0; i < field; ++i) begin = line.find(',', begin) + 1;
        line.replace(begin, line.find_first_of(",\n", begin) - begin, "x");
        EXPECT_THAT([&] { static_cast<void>(read(good + line)); },
                    testing::ThrowsMessage<std::runtime_error>(testing::AllOf(
                        testing::HasSubstr("dwells.csv:3: found '"),
                        testing::HasSubstr("expected the fields that the header names"))))
            << field;
    }
    EXPECT_THROW(static_cast<void>(read(good.substr(0, good.rfind(',')) + "\n")),
                 std::runtime_error);
    EXPECT_THROW(static_cast<void>(read(good.substr(0, good.rfind(',')) + ",-1\n")),
                 std::runtime_error);
}

TEST_F(DwellsCsv, ALastLineWithoutAnEndIsToldOrRefused) {
    const std::string good = order_line(full_order(), kOffset_ns);
    const auto told = [&](const std::string& lines) {
        testing::internal::CaptureStderr();
        static_cast<void>(read(lines));
        return testing::internal::GetCapturedStderr();
    };
    EXPECT_EQ(told(good), "");
    // 27.5 s
    EXPECT_THAT(told(good + good.substr(0, good.size() - 2)),
                testing::HasSubstr("dwells.csv:3: found no end of line behind '27.'"));
    EXPECT_THAT(told(good + "# restart after dwells: 1"), testing::HasSubstr("no end of line"));
    // As wide as a file of before
    std::string old = good;
    while (std::ranges::count(old, ',') > 24) old.erase(old.rfind(','));
    EXPECT_THAT([&] { static_cast<void>(read(good + old)); },
                testing::ThrowsMessage<std::runtime_error>(
                    testing::HasSubstr("dwells.csv:3: found 25 fields and no end of line")));
}

TEST_F(DwellsCsv, SweepsAndRestartsStandBetweenTheOrders) {
    const std::string order = order_line(full_order(), kOffset_ns);
    const std::string swept = swept_line({{{5'100'000'123, 2, 3, 40.5}}}, kOffset_ns);
    EXPECT_EQ(swept, "# swept: [2,3,[[1700000005100000,123,40.5]]]\n");
    EXPECT_EQ(restart_line(1), "# restart after dwells: 1\n");
    const Campaign campaign = read(order + swept + order + restart_line(1) + order);
    EXPECT_EQ(campaign.orders.size(), 2U);
    EXPECT_EQ(campaign.restarted_at, 1U);
    ASSERT_EQ(campaign.swept.size(), 1U);
    EXPECT_EQ(campaign.swept[0].time, 5'100'000'123);
    EXPECT_THROW(static_cast<void>(read(order + "# restart after dwells: many\n")),
                 std::runtime_error);
}

TEST_F(DwellsCsv, WhatWasPlayedStandsBehindItsOrder) {
    const std::string order = order_line(full_order(), kOffset_ns);
    Played played{5'000'001'000, 2, 3, {}, {{20.0, 0.01}, {40.0, 0.02}}};
    played.random.random.mean_square_g2 = 2.5;
    const auto is = read(order + played_line(played)).orders.at(0);
    ASSERT_TRUE(is.played);
    EXPECT_EQ(is.played->random.mean_square_g2, 2.5);
    EXPECT_EQ(is.played->random.profile, 19);
    EXPECT_EQ(is.psd, played.psd);
    played.psd[1][1] = std::numeric_limits<double>::infinity();  // JSON has none
    EXPECT_THAT(read(order + played_line(played)).orders.at(0).psd, testing::IsEmpty());
    played.run = 7;
    EXPECT_THROW(static_cast<void>(read(order + played_line(played))), std::runtime_error);
}

}  // namespace
}  // namespace vibrig::record
