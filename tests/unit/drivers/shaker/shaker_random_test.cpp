#include <gtest/gtest.h>

#include "test_bench.hpp"

namespace vibrig::drivers::test {
namespace {

// Addresses of the default register map.
constexpr int kMode = 8, kProfile = 9, kLevel = 10, kChecksum = 5, kRms = 7, kControl = 9;
constexpr std::uint32_t kSum = 0x89abcdef;

ShakerSettings with_random(const TestServer& server) {
    ShakerSettings settings = settings_for(server);
    settings.registers.random.emplace();
    return settings;
}
ShakerSetPoint profile(std::uint16_t number, double level_db = -3) {
    return {0, 2.0, 1.0, RandomSetPoint{number, level_db, kSum}};
}
void show_checksum(TestServer& server, std::uint32_t sum) {
    server.set_input(kChecksum, static_cast<std::uint16_t>(sum >> 16));
    server.set_input(kChecksum + 1, static_cast<std::uint16_t>(sum));
}

TEST(ShakerRandom, ProfileLevelAndModeBeforeAnythingMoves) {
    TestServer server;
    show_checksum(server, kSum);
    Bench bench(with_random(server));
    ASSERT_TRUE(bench.apply(profile(4)));
    EXPECT_EQ(addresses_written(server),
              (std::vector{kProfile, kLevel, kMode, kRampTime, kAmplitude, kRun}));
    EXPECT_EQ(server.holding(kProfile), 4);
    EXPECT_EQ(static_cast<std::int16_t>(server.holding(kLevel)), -30);
    EXPECT_EQ(server.holding(kMode), 1);
    // The checksum was read after the last write that chooses, and before the one that runs.
    const auto requests = server.requests();
    std::size_t chosen = 0, looked = 0, ran = 0;
    for (std::size_t i = 0; i < requests.size(); ++i) {
        if (requests[i].writes(kMode)) chosen = i;
        if (requests[i].function == 4 && requests[i].address == kChecksum &&
            requests[i].count == 2 && looked == 0)
            looked = i;
        if (requests[i].writes(kRun, 1)) ran = i;
    }
    EXPECT_LT(chosen, looked);
    EXPECT_LT(looked, ran);
}

TEST(ShakerRandom, AnotherChecksumMovesNothing) {
    TestServer server;
    show_checksum(server, kSum + 1);
    Bench bench(with_random(server));
    ASSERT_TRUE(bench.apply(profile(4)));
    EXPECT_EQ(server.holding(kRun), 0);
    EXPECT_EQ(addresses_written(server), (std::vector{kProfile, kLevel, kMode}));
    ASSERT_TRUE(bench.reaches(LinkState::degraded));
    EXPECT_NE(bench.said().back().second.find("profile checksum reads back as 2309737968, expected "
                                              "2309737967 of profile 4"),
              std::string::npos)
        << bench.said().back().second;
    EXPECT_EQ(bench.shaker->counters().read_back_mismatches, 1U);
    EXPECT_EQ(bench.shaker->counters().set_points_written, 0U);
}

TEST(ShakerRandom, AProfileThatIsNotTakenMovesNothing) {
    TestServer server;
    show_checksum(server, kSum);
    server.script([](const Request& request) {
        return request.writes(kProfile) ? Answer{Answer::Kind::ignore_write, 0, {}} : Answer{};
    });
    Bench bench(with_random(server));
    ASSERT_TRUE(bench.apply(profile(4)));
    EXPECT_EQ(server.holding(kRun), 0);
    EXPECT_EQ(server.holding(kMode), 0);
    ASSERT_TRUE(bench.reaches(LinkState::degraded));
}

TEST(ShakerRandom, KindProfileAndLevelChangeAtRestOnly) {
    TestServer server;
    show_checksum(server, kSum);
    Bench bench(with_random(server));
    ASSERT_TRUE(bench.apply(profile(4)));
    EXPECT_FALSE(bench.request(profile(5)));
    EXPECT_FALSE(bench.request(profile(4, 0)));
    EXPECT_FALSE(bench.request({15, 2, 1, {}}));
    // Down it may always come, and at rest it is a sine again.
    ASSERT_TRUE(bench.apply({0, 0, 1, RandomSetPoint{4, -3, kSum}}));
    server.forget();
    ASSERT_TRUE(bench.apply({15, 1, 1, {}}));
    EXPECT_EQ(addresses_written(server),
              (std::vector{kMode, kFrequency, kRampTime, kAmplitude, kRun}));
    EXPECT_EQ(server.holding(kMode), 0);
    EXPECT_FALSE(bench.request(profile(4)));
}

TEST(ShakerRandom, WhatTheControllerShows) {
    TestServer server;
    show_checksum(server, kSum);
    server.set_input(kRms + 1, 12345);
    server.set_input(kControl, 0x0212);
    Bench bench(with_random(server));
    ASSERT_TRUE(bench.apply(profile(4)));
    const auto reading = bench.shaker->reading();
    ASSERT_TRUE(reading.random);
    EXPECT_TRUE(reading.random->random && reading.random->bands_armed);
    EXPECT_EQ(reading.random->profile, 4);
    EXPECT_DOUBLE_EQ(reading.random->level_db, -3);
    EXPECT_EQ(reading.random->checksum, kSum);
    EXPECT_DOUBLE_EQ(reading.random->measured_g_rms, 1.2345);
    EXPECT_EQ(reading.random->state, RandomReading::State::at_level);
    EXPECT_EQ(reading.random->abort_reason, 2);
}

TEST(ShakerRandom, WhoeverChangesTheProfileUnderWayIsFound) {
    TestServer server;
    show_checksum(server, kSum);
    Bench bench(with_random(server));
    ASSERT_TRUE(bench.apply(profile(4)));
    show_checksum(server, 7);
    ASSERT_TRUE(bench.reaches(LinkState::degraded));
    EXPECT_NE(bench.said().back().second.find("profile checksum was changed by another"),
              std::string::npos);
}

TEST(ShakerRandom, WithoutRegistersThereAreSinesAlone) {
    TestServer server;
    Bench bench(settings_for(server));
    ASSERT_TRUE(bench.reaches(LinkState::running));
    EXPECT_FALSE(bench.request(profile(4)));
    EXPECT_FALSE(bench.shaker->reading().random);
    // Nor what the registers cannot hold.
    TestServer other;
    Bench random(with_random(other));
    ASSERT_TRUE(random.reaches(LinkState::running));
    EXPECT_FALSE(random.request(profile(0)));
    EXPECT_FALSE(random.request(profile(4, 4000)));
    auto settings = with_random(other);
    settings.registers.mode.access = proto::Access::read;
    RealClock clock;
    EXPECT_THROW(static_cast<void>(make_shaker(clock, settings)), ShakerError);
}

}  // namespace
}  // namespace vibrig::drivers::test
