#include "daemon/guard/shaker_line.hpp"

#include <gtest/gtest.h>

#include <chrono>

#include "test_server.hpp"

namespace vibrig::guard {
namespace {

using drivers::kSecond;
using drivers::test::Answer;
using drivers::test::Request;
using drivers::test::TestServer;

constexpr int kRun = 5, kWatchdog = 6;

ShakerLineSettings settings_of(const TestServer& server) {
    const proto::ShakerRegisters registers;
    return {"127.0.0.1", server.port(), 1, registers.run, registers.measured_amplitude};
}

TEST(ShakerLine, ReadsAndWritesNothingWhileNoStopIsWanted) {
    TestServer server;
    server.set_holding(kRun, 1);
    server.set_input(4, 50'000);
    ShakerLine line(settings_of(server));
    EXPECT_FALSE(line.word(0).known);
    for (int i = 0; i < 40; ++i) line.step(i * kSecond / 20, false);
    const auto word = line.word(2 * kSecond);
    EXPECT_TRUE(word.known);
    EXPECT_TRUE(word.runs);
    EXPECT_DOUBLE_EQ(word.measured_g, 5);
    EXPECT_TRUE(server.writes().empty());
    EXPECT_LE(server.requests().size(), 2 * 5u) << "twice a second";
}

TEST(ShakerLine, StopsAtOnceAndUntilItIsToldThatItMayEnd) {
    TestServer server;
    server.set_holding(kRun, 1);
    ShakerLine line(settings_of(server));
    line.step(0, false);
    // WHEN a stop is wanted between two polls
    line.step(kSecond / 20, true);
    EXPECT_EQ(server.holding(kRun), 0);
    EXPECT_FALSE(line.word(kSecond / 20).runs);
    // THEN it is ordered again five times a second, and nothing else is written
    for (int i = 2; i < 21; ++i) line.step(i * kSecond / 20, true);
    EXPECT_NEAR(static_cast<double>(line.stops_written()), 5, 1);
    for (const Request& write : server.writes()) EXPECT_TRUE(write.writes(kRun, 0));
}

TEST(ShakerLine, NeverFeedsTheWatchdog) {
    TestServer server;
    ShakerLine line(settings_of(server));
    for (int i = 0; i < 200; ++i) line.step(i * kSecond / 20, i > 100);
    for (const Request& write : server.writes()) EXPECT_NE(write.address, kWatchdog);
}

TEST(ShakerLine, LeavesForeignBitsOfTheRunRegisterAlone) {
    TestServer server;
    server.set_holding(kRun, 0x0f0f);
    auto settings = settings_of(server);
    settings.run.type = proto::RegisterType::bits;
    settings.run.mask = 0x0008;
    ShakerLine line(settings);
    line.step(0, true);
    EXPECT_EQ(server.holding(kRun), 0x0f07);
    EXPECT_FALSE(line.word(0).runs);
}

TEST(ShakerLine, AControllerThatDoesNotAnswerCostsHalfASecondAndIsSoughtAgain) {
    TestServer server;
    server.set_holding(kRun, 1);
    server.script([](const Request&) { return Answer{Answer::Kind::hang}; });
    ShakerLine line(settings_of(server));
    const auto begun = std::chrono::steady_clock::now();
    line.step(0, true);
    EXPECT_LT(std::chrono::steady_clock::now() - begun, std::chrono::seconds(5));
    EXPECT_FALSE(line.word(0).known);
    EXPECT_FALSE(line.note().empty());
    EXPECT_EQ(server.holding(kRun), 0) << "what was carried out and not answered";
    server.script({});
    line.step(kSecond, true);
    EXPECT_TRUE(line.word(kSecond).known);
    EXPECT_TRUE(line.note().empty());
}

TEST(ShakerLine, WhatWasReadTwoSecondsAgoIsNotKnownAnyMore) {
    TestServer server;
    ShakerLine line(settings_of(server));
    line.step(0, false);
    line.step(kSecond, false);
    EXPECT_TRUE(line.word(3 * kSecond).known);
    EXPECT_FALSE(line.word(3 * kSecond + 1).known);
}

TEST(ShakerLine, AHostThatCannotBeResolvedIsToldAtTheStart) {
    ShakerLineSettings settings;
    settings.host = "256.256.256.256";
    EXPECT_THROW(ShakerLine{settings}, std::runtime_error);
}

}  // namespace
}  // namespace vibrig::guard
