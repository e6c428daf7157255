// The identity that the controller reports: asked of each new link, at rest only, and never in the
// way.
#include <gtest/gtest.h>

#include <algorithm>

#include "test_bench.hpp"

namespace vibrig::drivers::test {
namespace {

constexpr int kWho = 17;

ShakerSettings asking(const TestServer& server) {
    auto settings = settings_for(server);
    settings.identify = 300 * kMillisecond;
    settings.watchdog_period = 100 * kMillisecond;
    return settings;
}

long asked(const TestServer& server) {
    const auto all = server.requests();
    return std::ranges::count(all, kWho, &Request::function);
}

TEST(ShakerIdentity, IsAskedOnceOfALink) {
    TestServer server;
    server.identify_as("ACME VC-3 2.11");
    Bench bench(asking(server));
    ASSERT_TRUE(bench.reaches(LinkState::running));
    ASSERT_TRUE(bench.eventually([&] { return bench.shaker->identity().known; }));
    EXPECT_EQ(bench.shaker->identity().text, "ACME VC-3 2.11");
    ASSERT_TRUE(bench.apply({15.0, 9.0, 1.0}));
    EXPECT_EQ(asked(server), 1);
    EXPECT_EQ(bench.shaker->counters().reconnects, 0U);
}

TEST(ShakerIdentity, NobodyIsAskedWhereNoRecordNeedsIt) {
    TestServer server;
    Bench bench(settings_for(server));
    ASSERT_TRUE(bench.apply({15.0, 9.0, 1.0}));
    EXPECT_EQ(asked(server), 0);
    EXPECT_FALSE(bench.shaker->identity().known);
}

TEST(ShakerIdentity, AnotherDeviceBehindTheSameAddressIsSeen) {
    TestServer server;
    server.identify_as("ACME VC-3 2.11");
    Bench bench(asking(server));
    ASSERT_TRUE(bench.eventually([&] { return bench.shaker->identity().known; }));
    server.identify_as("OTHER 7");
    server.script(
        [](const Request& r) { return r.function == 3 ? Answer{Answer::Kind::close} : Answer{}; });
    // Until it has answered nobody knows who it is.
    ASSERT_TRUE(bench.eventually([&] { return !bench.shaker->identity().known; }));
    server.script({});
    ASSERT_TRUE(bench.eventually([&] { return bench.shaker->identity().known; }));
    EXPECT_EQ(bench.shaker->identity().text, "OTHER 7");
}

TEST(ShakerIdentity, WhoDoesNotKnowTheFunctionSaysNothing) {
    for (const auto kind : {Answer::Kind::exception, Answer::Kind::swallow, Answer::Kind::close}) {
        TestServer server;
        server.script([kind](const Request& r) {
            return r.function == kWho ? Answer{kind, 1} : Answer{};
        });
        Bench bench(asking(server));
        ASSERT_TRUE(bench.eventually([&] { return bench.shaker->identity().known; }));
        EXPECT_EQ(bench.shaker->identity().text, "");
        ASSERT_TRUE(bench.reaches(LinkState::running)) << "an exception to it degrades nothing";
        ASSERT_TRUE(bench.apply({15.0, 9.0, 1.0}));
        // Silence costs the link: twice, and no more.
        const auto times = kind == Answer::Kind::exception ? 1 : 2;
        EXPECT_EQ(asked(server), times);
        EXPECT_EQ(bench.shaker->counters().reconnects, times == 1 ? 0U : 2U);
    }
}

TEST(ShakerIdentity, IsNotAskedWhileTheTableMoves) {
    TestServer server;
    server.identify_as("ACME");
    // As another process left it.
    server.set_holding(kRun, 1);
    server.set_input(0, 2);
    Bench bench(asking(server));
    ASSERT_TRUE(bench.reaches(LinkState::running));
    const auto polls = server.requests().size() + 40;
    ASSERT_TRUE(bench.eventually([&] { return server.requests().size() > polls; }));
    EXPECT_EQ(asked(server), 0);
    bench.shaker->stop_now();
    ASSERT_TRUE(bench.eventually([&] { return bench.shaker->identity().known; }));
    const auto all = server.requests();
    const auto stop = std::ranges::find_if(all, [](const Request& r) { return r.writes_run(); });
    const auto who = std::ranges::find(all, kWho, &Request::function);
    EXPECT_LT(stop, who) << "first it is stopped";
}

TEST(ShakerIdentity, AStopDoesNotWaitForIt) {
    TestServer server;
    server.script([](const Request& r) {
        return r.function == kWho ? Answer{Answer::Kind::swallow} : Answer{};
    });
    auto settings = asking(server);
    settings.identify = 8 * kSecond;
    Bench bench(settings);
    ASSERT_TRUE(server.saw([](const Request& r) { return r.function == kWho; }));
    const auto from = std::chrono::steady_clock::now();
    bench.shaker->stop_now();
    ASSERT_TRUE(server.saw([](const Request& r) { return r.writes_run(); }));
    EXPECT_LT(std::chrono::steady_clock::now() - from, std::chrono::seconds(4));
}

}  // namespace
}  // namespace vibrig::drivers::test
