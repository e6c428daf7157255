#include <gtest/gtest.h>

#include "test_bench.hpp"

namespace vibrig::drivers::test {
namespace {

// Addresses of the default register map.
constexpr int kSweepMode = 8, kFrom = 11, kTo = 13, kRate = 15, kActual = 10;

ShakerSettings with_sweeps(const TestServer& server) {
    ShakerSettings settings = settings_for(server);
    settings.registers.sweep.emplace();
    return settings;
}
ShakerSetPoint sweep(double from_hz, double to_hz, double rate = 1.25) {
    ShakerSetPoint point{0, 2.0, 1.0};
    point.sweep = SweepSetPoint{from_hz, to_hz, rate};
    return point;
}
std::uint32_t joined(const TestServer& server, int address) {
    return static_cast<std::uint32_t>(server.holding(address)) << 16 |
           static_cast<std::uint32_t>(server.holding(address + 1));
}

TEST(ShakerSweep, EndsRateAndModeBeforeAnythingMoves) {
    TestServer server;
    Bench bench(with_sweeps(server));
    ASSERT_TRUE(bench.apply(sweep(20, 120)));
    EXPECT_EQ(addresses_written(server),
              (std::vector{kFrom, kTo, kRate, kSweepMode, kRampTime, kAmplitude, kRun}));
    EXPECT_EQ(joined(server, kFrom), 20000U);
    EXPECT_EQ(joined(server, kTo), 120000U);
    EXPECT_EQ(server.holding(kRate), 125);
    EXPECT_EQ(server.holding(kSweepMode), 2);
    const auto reading = bench.shaker->reading();
    ASSERT_TRUE(reading.sweep);
    EXPECT_TRUE(reading.sweep->is({20, 120, 1.25}));
    EXPECT_FALSE(reading.sweep->is({120, 20, 1.25}));
    EXPECT_FALSE(reading.sweep->is({20, 120, 1.5}));
}

TEST(ShakerSweep, AnEndThatIsNotTakenMovesNothing) {
    TestServer server;
    server.script([](const Request& request) {
        return request.writes(kTo) ? Answer{Answer::Kind::ignore_write, 0, {}} : Answer{};
    });
    Bench bench(with_sweeps(server));
    ASSERT_TRUE(bench.apply(sweep(20, 120)));
    EXPECT_EQ(server.holding(kRun), 0);
    EXPECT_EQ(server.holding(kSweepMode), 0);
    ASSERT_TRUE(bench.reaches(LinkState::degraded));
}

TEST(ShakerSweep, ChangesAtRestOnly) {
    TestServer server;
    Bench bench(with_sweeps(server));
    ASSERT_TRUE(bench.apply(sweep(20, 120)));
    EXPECT_FALSE(bench.request(sweep(120, 20)));
    EXPECT_FALSE(bench.request(sweep(20, 120, 2.5)));
    EXPECT_FALSE(bench.request({15, 2, 1}));
    // Down it may always come, and at rest it is a sine again.
    auto down = sweep(20, 120);
    down.amplitude_g = 0;
    ASSERT_TRUE(bench.apply(down));
    server.forget();
    ASSERT_TRUE(bench.apply({15, 1, 1}));
    EXPECT_EQ(addresses_written(server),
              (std::vector{kSweepMode, kFrequency, kRampTime, kAmplitude, kRun}));
    EXPECT_EQ(server.holding(kSweepMode), 0);
}

TEST(ShakerSweep, WhereItIs) {
    TestServer server;
    server.set_input(kActual, 1);
    server.set_input(kActual + 1, 0x1170);  // 70 Hz
    Bench bench(with_sweeps(server));
    ASSERT_TRUE(bench.apply(sweep(20, 120)));
    EXPECT_NEAR(bench.shaker->reading().sweep->actual_hz, 70.0, 1e-9);
}

TEST(ShakerSweep, WhoeverChangesItUnderWayIsFound) {
    TestServer server;
    Bench bench(with_sweeps(server));
    ASSERT_TRUE(bench.apply(sweep(20, 120)));
    server.set_holding(kRate, 250);
    ASSERT_TRUE(bench.reaches(LinkState::degraded));
    EXPECT_NE(bench.said().back().second.find("sweep rate was changed by another"),
              std::string::npos)
        << bench.said().back().second;
}

TEST(ShakerSweep, WithoutRegistersThereAreNone) {
    TestServer server;
    Bench bench(settings_for(server));
    EXPECT_FALSE(bench.request(sweep(20, 120)));
    EXPECT_FALSE(bench.shaker->reading().sweep);
}

TEST(ShakerSweep, WhatTheRegistersCannotHoldIsNoSetPoint) {
    TestServer server;
    Bench bench(with_sweeps(server));
    EXPECT_FALSE(bench.request(sweep(20, 120, 0)));
    EXPECT_FALSE(bench.request(sweep(20, 120, 700)));
    EXPECT_FALSE(bench.request(sweep(-20, 120)));
    auto both = sweep(20, 120);
    both.random = RandomSetPoint{4, -3, 1};
    EXPECT_FALSE(bench.request(both));
}

}  // namespace
}  // namespace vibrig::drivers::test
