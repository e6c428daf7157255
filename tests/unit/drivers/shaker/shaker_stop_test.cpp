#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <optional>

#include "manual_clock.hpp"
#include "test_bench.hpp"
#include "tests/unit/support/host_names.hpp"
#include "tests/unit/support/mute_host.hpp"

namespace vibrig::drivers::test {
namespace {

using Kind = Answer::Kind;

constexpr ShakerSetPoint kRunning{15.0, 1.0, 1.0};

[[nodiscard]] bool is_poll(const Request& request) { return !request.is_write(); }

TEST(ShakerStop, StopsARunningShaker) {
    TestServer server;
    Bench bench(settings_for(server));
    ASSERT_TRUE(bench.apply(kRunning));
    bench.shaker->stop_now();
    ASSERT_TRUE(bench.eventually([&] { return !bench.shaker->stop_pending(); }));
    EXPECT_EQ(server.holding(kRun), 0);
    EXPECT_GE(bench.shaker->counters().stops_written, 1U);
}

TEST(ShakerStop, CutsOffAHangingRequestAndIsTheNextWrite) {
    // GIVEN a response timeout far beyond this test's patience, and a server that stops answering
    std::atomic<bool> hung = false;  // before the server, whose thread asks it to the end
    TestServer server;
    ShakerSettings settings = settings_for(server);
    settings.response_timeout = 60 * kSecond;
    Bench bench(settings);
    ASSERT_TRUE(bench.apply(kRunning));
    server.script([&](const Request& request) {
        if (hung.exchange(true) || !is_poll(request)) {
            return hung.load() && request.connection == 1 ? Answer{Kind::hang, 0, {}} : Answer{};
        }
        return Answer{Kind::hang, 0, {}};
    });
    ASSERT_TRUE(bench.eventually([&] { return hung.load(); }));
    server.forget();
    // WHEN it is stopped
    bench.shaker->stop_now();
    // THEN the stop is through on a new connection, long before the timeout, and was the first
    // write
    ASSERT_TRUE(bench.eventually([&] { return !bench.shaker->stop_pending(); }));
    const auto writes = server.writes();
    ASSERT_FALSE(writes.empty());
    EXPECT_TRUE(writes.front().writes(kRun, 0));
    EXPECT_EQ(writes.front().connection, 2);
    EXPECT_EQ(bench.shaker->counters().timeouts, 0U);
    EXPECT_EQ(bench.shaker->counters().lost, 1U);
}

TEST(ShakerStop, IsNotHeldUpByADeadAddressOfTheName) {
    // GIVEN a name with two addresses, of which the second is the shaker's, and a request in flight
    std::atomic<bool> hung = false;  // before the server, whose thread asks it to the end
    TestServer server;
    const HostName name("shaker.test", {"127.0.0.2", "127.0.0.1"});
    ShakerSettings settings = settings_for(server);
    settings.host = "shaker.test";
    settings.response_timeout = 60 * kSecond;
    Bench bench(settings);
    ASSERT_TRUE(bench.apply(kRunning));
    server.script([&](const Request& request) {
        if (request.connection != 1) return Answer{};
        hung = true;
        return Answer{Kind::hang, 0, {}};
    });
    ASSERT_TRUE(bench.eventually([&] { return hung.load(); }));
    // WHEN it is stopped, while nothing that comes to the first address is answered
    const MuteHost first("127.0.0.2", server.port());
    bench.shaker->stop_now();
    // THEN the stop goes to the second at once
    ASSERT_TRUE(bench.eventually([&] { return !bench.shaker->stop_pending(); }));
    EXPECT_FALSE(first.called());
    EXPECT_EQ(server.holding(kRun), 0);
}

TEST(ShakerStop, LeavesNoSetPointBehind) {
    // GIVEN a set-point whose first write hangs, and one that waits behind it
    TestServer server;
    ShakerSettings settings = settings_for(server);
    settings.response_timeout = 60 * kSecond;
    Bench bench(settings);
    ASSERT_TRUE(bench.reaches(LinkState::running));
    server.script([](const Request& request) {
        return request.writes(kRampTime) ? Answer{Kind::hang, 0, {}} : Answer{};
    });
    ASSERT_TRUE(bench.request(kRunning));
    ASSERT_TRUE(server.saw([](const Request& r) { return r.writes(kRampTime); }));
    EXPECT_TRUE(bench.shaker->busy());
    ASSERT_TRUE(bench.request({15.0, 2.0, 1.0}));
    server.forget();
    // WHEN it is stopped, and one more is asked for under the arming before, be the stop done or
    // not
    const std::uint64_t armed = bench.shaker->stops();
    bench.shaker->stop_now();
    EXPECT_FALSE(bench.shaker->request({15.0, 3.0, 1.0}, armed));
    // THEN both are gone, and counted
    ASSERT_TRUE(
        bench.eventually([&] { return !bench.shaker->stop_pending() && !bench.shaker->busy(); }));
    ASSERT_TRUE(bench.reaches(LinkState::running));
    EXPECT_EQ(addresses_written(server), std::vector{kRun});
    EXPECT_EQ(server.holding(kRun), 0);
    EXPECT_EQ(bench.shaker->counters().set_points_discarded, 2U);
}

TEST(ShakerStop, IsTheFirstWriteToAServerThatComesBack) {
    // GIVEN a shaker whose server dies
    std::optional<TestServer> server(std::in_place);
    const int port = server->port();
    Bench bench(settings_for(*server));
    ASSERT_TRUE(bench.apply(kRunning));
    server.reset();
    ASSERT_TRUE(bench.reaches(LinkState::connecting));
    // WHEN it is stopped and the server returns later, running
    bench.shaker->stop_now();
    ASSERT_FALSE(bench.eventually([&, n = 0]() mutable {
        return !bench.shaker->stop_pending() || ++n > 50;
    }) && !bench.shaker->stop_pending());
    server.emplace(TestServer::Line::tcp, port);
    // THEN the stop was not forgotten, and comes before the watchdog
    ASSERT_TRUE(bench.eventually([&] { return !bench.shaker->stop_pending(); }));
    ASSERT_TRUE(server->saw([](const Request& r) { return r.writes(kWatchdog); }));
    EXPECT_TRUE(server->writes().front().writes(kRun, 0));
}

TEST(ShakerStop, DiscardsASetPointWhenTheLinkIsLost) {
    TestServer server;
    Bench bench(settings_for(server));
    ASSERT_TRUE(bench.reaches(LinkState::running));
    // GIVEN a set-point that waits while the connection ends
    server.script([](const Request& request) {
        return request.connection == 1 && request.writes(kRampTime) ? Answer{Kind::close, 0, {}}
                                                                    : Answer{};
    });
    ASSERT_TRUE(bench.request(kRunning));
    ASSERT_TRUE(bench.eventually([&] { return bench.shaker->counters().reconnects >= 1; }));
    ASSERT_TRUE(bench.reaches(LinkState::running));
    // THEN excitation does not recover by itself
    EXPECT_FALSE(bench.shaker->busy());
    EXPECT_EQ(bench.shaker->counters().set_points_discarded, 1U);
    EXPECT_EQ(server.holding(kRun), 0);
    EXPECT_EQ(addresses_written(server), (std::vector{kFrequency, kRampTime}));
}

TEST(ShakerStop, IsRepeatedUntilItIsReadBackAndTheWatchdogStarves) {
    // GIVEN a running device that acknowledges a stop and goes on
    TestServer server;
    Bench bench(settings_for(server));
    ASSERT_TRUE(bench.apply(kRunning));
    server.script([](const Request& request) {
        return request.writes(kRun, 0) ? Answer{Kind::ignore_write, 0, {}} : Answer{};
    });
    // WHEN it is stopped
    bench.shaker->stop_now();
    const auto before = bench.shaker->counters();
    ASSERT_TRUE(bench.eventually(
        [&] { return bench.shaker->counters().stops_written >= before.stops_written + 20; }));
    // THEN it tries again and again, and does not feed the watchdog (one feed may have been under
    // way)
    EXPECT_TRUE(bench.shaker->stop_pending());
    EXPECT_LE(bench.shaker->counters().feeds, before.feeds + 1);
    EXPECT_EQ(bench.shaker->state(), LinkState::degraded);
    EXPECT_FALSE(bench.request(kRunning));
    // WHEN the device obeys at last THEN all is well
    server.script({});
    EXPECT_TRUE(bench.reaches(LinkState::running));
    EXPECT_FALSE(bench.shaker->stop_pending());
    EXPECT_TRUE(
        bench.eventually([&] { return bench.shaker->counters().feeds > before.feeds + 1; }));
}

TEST(ShakerStop, IsRepeatedWhenTheDeviceRefusesIt) {
    std::atomic<int> refused = 0;  // before the server, whose thread asks it to the end
    TestServer server;
    Bench bench(settings_for(server));
    ASSERT_TRUE(bench.apply(kRunning));
    server.script([&](const Request& request) {
        return request.writes(kRun, 0) && ++refused <= 3 ? Answer{Kind::exception, 6, {}}
                                                         : Answer{};
    });
    bench.shaker->stop_now();
    ASSERT_TRUE(bench.eventually([&] { return !bench.shaker->stop_pending(); }));
    EXPECT_EQ(refused.load(), 4);
    EXPECT_EQ(server.holding(kRun), 0);
}

TEST(ShakerStop, IsRepeatedWhateverTheBackoffOfTheLinkIs) {
    std::atomic<int> refused = 0;
    TestServer server;
    ShakerSettings settings = settings_for(server);
    settings.backoff_min = settings.backoff_max = 60 * kSecond;
    Bench bench(settings);
    ASSERT_TRUE(bench.apply(kRunning));
    // GIVEN a controller that is busy, and then one that cuts the line
    server.script([&](const Request& request) {
        if (!request.writes(kRun, 0) || ++refused > 4) return Answer{};
        return refused <= 3 ? Answer{Kind::exception, 6, {}} : Answer{Kind::close, 0, {}};
    });
    const auto began = std::chrono::steady_clock::now();
    bench.shaker->stop_now();
    ASSERT_TRUE(bench.eventually([&] { return !bench.shaker->stop_pending(); }));
    EXPECT_LT(std::chrono::steady_clock::now() - began, std::chrono::seconds(5));
    EXPECT_EQ(server.holding(kRun), 0);
}

TEST(ShakerStop, IsWrittenAtOnceWhenItIsOrderedAgain) {
    TestServer server;
    ManualClock clock;
    const auto shaker = make_shaker(clock, settings_for(server));
    shaker->start([] { return true; }, {});
    static_cast<void>(clock.rest());
    // GIVEN a stop that was refused, on a clock that stands still
    server.script([](const Request& request) {
        return request.writes(kRun, 0) ? Answer{Kind::exception, 6, {}} : Answer{};
    });
    shaker->stop_now();
    static_cast<void>(clock.rest());
    const auto before = server.writes().size();
    static_cast<void>(clock.rest());
    EXPECT_EQ(server.writes().size(), before);
    // WHEN it is ordered again THEN it does not wait for its turn
    shaker->stop_now();
    static_cast<void>(clock.rest());
    ASSERT_GT(server.writes().size(), before);
    EXPECT_TRUE(server.writes().back().writes(kRun, 0));
    EXPECT_TRUE(shaker->stop_pending());
    shaker->shut_down();
}

TEST(ShakerStop, MayComeBeforeTheStart) {
    TestServer server;
    RealClock clock;
    const auto shaker = make_shaker(clock, settings_for(server));
    shaker->stop_now();
    EXPECT_TRUE(shaker->stop_pending());
    shaker->start([] { return true; }, {});
    ASSERT_TRUE(server.saw([](const Request& r) { return r.writes(kWatchdog); }));
    EXPECT_TRUE(server.writes().front().writes(kRun, 0));
}

TEST(ShakerStop, MayComeFromManyThreadsAtOnce) {
    TestServer server;
    Bench bench(settings_for(server));
    ASSERT_TRUE(bench.apply(kRunning));
    std::vector<std::thread> threads;
    for (int i = 0; i < 4; ++i) {
        threads.emplace_back([&] {
            for (int n = 0; n < 100; ++n) {
                bench.shaker->stop_now();
                static_cast<void>(bench.request(kRunning));
                static_cast<void>(bench.shaker->reading());
            }
        });
    }
    for (std::thread& thread : threads) thread.join();
    bench.shaker->stop_now();
    ASSERT_TRUE(
        bench.eventually([&] { return !bench.shaker->stop_pending() && !bench.shaker->busy(); }));
    EXPECT_EQ(server.holding(kRun), 0);
}

TEST(ShakerStop, IsNotUndoneByWhoWasArmedBeforeIt) {
    TestServer server;
    Bench bench(settings_for(server));
    ASSERT_TRUE(bench.apply(kRunning));
    // GIVEN a stop that is over and confirmed before a slow thread asks for more
    const std::uint64_t armed = bench.shaker->stops();
    bench.shaker->stop_now();
    ASSERT_TRUE(bench.eventually([&] { return !bench.shaker->stop_pending(); }));
    server.forget();
    // THEN it is refused, and nothing is written; whoever arms anew may ask
    EXPECT_FALSE(bench.shaker->request(kRunning, armed));
    EXPECT_EQ(bench.shaker->stops(), armed + 1);
    EXPECT_FALSE(bench.shaker->busy());
    ASSERT_TRUE(bench.reaches(LinkState::running)) << "the stop may have cut the link";
    EXPECT_TRUE(bench.request(kRunning));
}

TEST(ShakerStop, EndsAThreadThatHangs) {
    // GIVEN a request that nobody answers for a minute
    TestServer server;
    ShakerSettings settings = settings_for(server);
    settings.response_timeout = 60 * kSecond;
    server.script([](const Request&) { return Answer{Kind::hang, 0, {}}; });
    const auto began = std::chrono::steady_clock::now();
    {
        Bench bench(settings);
        ASSERT_TRUE(server.saw([](const Request&) { return true; }));
        bench.shaker->shut_down();
        EXPECT_EQ(bench.shaker->state(), LinkState::absent);
    }
    // THEN shutting down does not wait for it
    EXPECT_LT(std::chrono::steady_clock::now() - began, std::chrono::seconds(30));
}

}  // namespace
}  // namespace vibrig::drivers::test
