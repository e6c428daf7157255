#include "daemon/guard/shaker_line.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>

#include "test_server.hpp"
#include "tests/unit/support/host_names.hpp"
#include "tests/unit/support/mute_host.hpp"

namespace vibrig::guard {
namespace {

using drivers::kSecond;
using drivers::test::Answer;
using drivers::test::Request;
using drivers::test::TestServer;

constexpr int kRamp = 4, kRun = 5, kWatchdog = 6;

ShakerLineSettings settings_of(const TestServer& server) {
    const proto::ShakerRegisters registers;
    return {"127.0.0.1",         server.port(), 1,
            registers.ramp_time, registers.run, registers.measured_amplitude};
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

TEST(ShakerLine, StopsAtOnceAndUntilItMayEnd) {
    TestServer server;
    server.set_holding(kRun, 1);
    server.set_holding(kRamp, 6000);
    ShakerLine line(settings_of(server));
    line.step(0, false);
    // WHEN a stop is wanted between two polls
    line.step(kSecond / 20, true);
    EXPECT_EQ(server.holding(kRun), 0);
    EXPECT_EQ(server.holding(kRamp), 0) << "not as slowly as comfort wants";
    ASSERT_EQ(server.writes().size(), 1U) << "in one request";
    EXPECT_FALSE(line.word(kSecond / 20).runs);
    // THEN it is ordered again five times a second, and nothing else is written
    for (int i = 2; i < 21; ++i) line.step(i * kSecond / 20, true);
    EXPECT_NEAR(static_cast<double>(line.stops_written()), 5, 1);
    for (const Request& write : server.writes()) EXPECT_TRUE(write.writes(kRun, 0));
}

TEST(ShakerLine, TriesTheRampOnceWhereItCannotGoWithTheStop) {
    TestServer server;
    server.set_holding(kRun, 1);
    auto settings = settings_of(server);
    settings.ramp_time.address = 40;
    // Never answered: the stop follows on another connection.
    server.script([](const Request& request) {
        return Answer{request.writes(40) ? Answer::Kind::hang : Answer::Kind::normal, 0, {}};
    });
    ShakerLine line(settings);
    line.step(0, true);
    EXPECT_EQ(server.holding(kRun), 0);
    EXPECT_EQ(server.writes().back().connection, 2) << "no late answer is taken for its own";
    for (int i = 1; i < 21; ++i) line.step(i * kSecond / 20, true);
    int ramps = 0;
    for (const Request& write : server.writes()) ramps += write.writes(40);
    EXPECT_EQ(ramps, 1);
}

TEST(ShakerLine, ADeviceThatTakesOneRegisterAtATimeIsStoppedAllTheSame) {
    TestServer server;
    server.set_holding(kRun, 1);
    server.set_holding(kRamp, 6000);
    server.script([](const Request& request) {
        constexpr int kIllegalAddress = 2;
        if (request.function == 16 && request.count > 1)
            return Answer{Answer::Kind::exception, kIllegalAddress, {}};
        return Answer{};
    });
    ShakerLine line(settings_of(server));
    line.step(0, true);
    EXPECT_EQ(server.holding(kRun), 0);
    EXPECT_EQ(server.holding(kRamp), 0);
}

bool is_joint(const Request& request) { return request.writes_run() && request.count > 1; }

TEST(ShakerLine, AfterOneJointWriteThatCameToNothingRunZeroGoesAlone) {
    for (const auto joint :
         {Answer::Kind::swallow, Answer::Kind::ignore_write, Answer::Kind::close}) {
        TestServer server;
        server.set_holding(kRun, 1);
        server.set_holding(kRamp, 6000);
        server.script([joint](const Request& request) {
            return Answer{is_joint(request) ? joint : Answer::Kind::normal, 0, {}};
        });
        ShakerLine line(settings_of(server));
        // WHEN it looks twice, 50 ms apart
        line.step(0, true);
        line.step(kSecond / 20, true);
        // THEN they have gone out as if they lay apart, run 0 alone
        const auto writes = server.writes();
        ASSERT_GE(writes.size(), 3U) << static_cast<int>(joint);
        EXPECT_TRUE(is_joint(writes[0]));
        EXPECT_TRUE(writes[1].writes(kRamp, 0));
        EXPECT_TRUE(writes[2].writes(kRun, 0));
        EXPECT_EQ(server.holding(kRun), 0);
        EXPECT_EQ(server.holding(kRamp), 0);
        EXPECT_FALSE(line.word(kSecond / 20).runs);
        // AND so it goes on until this stop is done
        for (int i = 2; i < 21; ++i) line.step(i * kSecond / 20, true);
        const auto all = server.writes();
        EXPECT_EQ(std::count_if(all.begin(), all.end(), is_joint), 1);
        EXPECT_GE(all.size(), writes.size() + 3);
        // AND the next begins as every one
        line.step(2 * kSecond, false);
        server.script({});
        server.forget();
        line.step(3 * kSecond, true);
        EXPECT_TRUE(is_joint(server.writes().front()));
    }
}

TEST(ShakerLine, AJointWriteThatCameToNothingIsNotTriedAgainOverReconnections) {
    for (const auto joint :
         {Answer::Kind::swallow, Answer::Kind::ignore_write, Answer::Kind::exception}) {
        int alone = 0;  // before the server, whose thread asks it to the end
        TestServer server;
        server.set_holding(kRun, 1);
        server.set_holding(kRamp, 6000);
        server.script([&alone, joint](const Request& request) {
            if (is_joint(request)) return Answer{joint, 1, {}};
            const bool ends = request.writes_run() && ++alone <= 3;
            return Answer{ends ? Answer::Kind::close : Answer::Kind::normal, 0, {}};
        });
        ShakerLine line(settings_of(server));
        for (int i = 0; i < 40; ++i) line.step(i * kSecond / 20, true);
        const auto writes = server.writes();
        EXPECT_EQ(std::count_if(writes.begin(), writes.end(), is_joint), 1)
            << static_cast<int>(joint);
        EXPECT_GE(writes.back().connection, 4);
        EXPECT_EQ(server.holding(kRun), 0);
        EXPECT_EQ(server.holding(kRamp), 0);
    }
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
    server.set_holding(kRamp, 6000);
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

TEST(ShakerLine, StopsAtWhicheverAddressOfTheNameTheControllerIs) {
    TestServer server;
    server.set_holding(kRun, 1);
    // GIVEN a name whose first address swallows what comes
    const MuteHost first("127.0.0.2", server.port(), MuteHost::Takes::nothing);
    const HostName name("controller.test", {"127.0.0.2", "127.0.0.1"});
    auto settings = settings_of(server);
    settings.host = "controller.test";
    ShakerLine line(settings);
    line.step(kSecond, true);
    EXPECT_EQ(server.holding(kRun), 0) << line.note();
    EXPECT_TRUE(line.word(kSecond).known) << line.note();
}

TEST(ShakerLine, WhatWasReadTwoSecondsAgoIsNotKnownAnyMore) {
    TestServer server;
    ShakerLine line(settings_of(server));
    line.step(0, false);
    line.step(kSecond, false);
    EXPECT_TRUE(line.word(3 * kSecond).known);
    EXPECT_FALSE(line.word(3 * kSecond + 1).known);
}

TEST(ShakerLine, AHostThatCannotBeResolvedIsReportedAtTheStart) {
    const auto settings = parse_settings(
        "guard.socket = \"@g\"\ncommission.simulated = true\n[shaker]\nhost = "
        "\"256.256.256.256\"\n",
        "rig.toml");
    try {
        const ShakerLine line(settings.shaker);
        FAIL() << "resolved";
    } catch (const SettingsError&) {
        FAIL() << "it may be over with a later start";
    } catch (const std::runtime_error& error) {
        const std::string said = error.what();
        EXPECT_EQ(said.rfind("rig.toml:4:8: shaker.host: found \"256.256.256.256\" (", 0), 0U)
            << said;
        EXPECT_NE(said.find("), expected a host that can be resolved"), std::string::npos) << said;
    }
}

}  // namespace
}  // namespace vibrig::guard
