#include <gtest/gtest.h>

#include <algorithm>
#include <optional>

#include "manual_clock.hpp"
#include "test_bench.hpp"

namespace vibrig::drivers::test {
namespace {

[[nodiscard]] auto polls(const TestServer& server) {
    const auto requests = server.requests();
    return std::count_if(requests.begin(), requests.end(),
                         [](const Request& r) { return r.function == 4; });
}

[[nodiscard]] ShakerSettings periods(ShakerSettings settings) {
    settings.poll_period = 200 * kMillisecond;
    settings.watchdog_period = 500 * kMillisecond;
    settings.backoff_min = 100 * kMillisecond;
    settings.backoff_max = 700 * kMillisecond;
    return settings;
}

TEST(ShakerTime, PollsAndFeedsOnTheClockOnly) {
    // GIVEN a clock that stands still
    TestServer server;
    ManualClock clock;
    const auto shaker = make_shaker(clock, periods(settings_for(server)));
    shaker->start([] { return true; }, {});
    // WHEN ten seconds pass on it, as fast as the thread can follow
    Time now = 0;
    for (now = clock.rest(); now <= 10 * kSecond; now = clock.rest()) clock.set(now);
    // THEN it has polled every 200 ms and fed every 500 ms, both also at 0 s, not once more or less
    EXPECT_EQ(polls(server), 51);
    EXPECT_EQ(shaker->counters().feeds, 21U);
    EXPECT_EQ(shaker->reading().time, 10 * kSecond);
    const ShakerCounters counters = shaker->counters();
    EXPECT_EQ(counters.requests, counters.replies);
    shaker->shut_down();
}

TEST(ShakerTime, InvalidatesAReadingAfterTwoWatchdogPeriods) {
    TestServer server;
    ManualClock clock;
    const auto shaker = make_shaker(clock, periods(settings_for(server)));
    shaker->start([] { return true; }, {});
    static_cast<void>(clock.rest());
    ASSERT_TRUE(shaker->reading().valid);
    // GIVEN a device that refuses to be read
    server.script([](const Request& request) {
        return request.is_write() ? Answer{} : Answer{Answer::Kind::exception, 4, {}};
    });
    for (Time now = clock.rest(); now <= kSecond; now = clock.rest()) clock.set(now);
    // THEN the last reading is good for twice the watchdog's 500 ms and not longer
    EXPECT_TRUE(shaker->reading().valid);
    EXPECT_EQ(shaker->state(), LinkState::degraded);
    clock.set(kSecond + 1);
    EXPECT_FALSE(shaker->reading().valid);
    shaker->shut_down();
}

TEST(ShakerTime, DoublesItsBackoffButNotForAStop) {
    // GIVEN a port where nobody listens
    ShakerSettings settings;
    {
        TestServer gone;
        settings = periods(settings_for(gone));
    }
    ManualClock clock;
    const auto shaker = make_shaker(clock, settings);
    shaker->start([] { return true; }, {});
    // WHEN it tries again and again
    const auto next_wait = [&] {
        const Time before = clock.now(), until = clock.rest();
        clock.set(until);
        return (until - before) / kMillisecond;
    };
    std::vector<Time> waits;
    for (int i = 0; i < 6; ++i) waits.push_back(next_wait());
    // THEN it waits longer and longer, up to the limit
    EXPECT_EQ(waits, (std::vector<Time>{100, 200, 400, 700, 700, 700}));
    // WHEN there is a stop to deliver THEN it tries at once, and then every 100 ms
    static_cast<void>(clock.rest());
    shaker->stop_now();
    waits.clear();
    for (int i = 0; i < 3; ++i) waits.push_back(next_wait());
    EXPECT_EQ(waits, (std::vector<Time>{100, 100, 100}));
    EXPECT_TRUE(shaker->stop_pending());
    shaker->shut_down();
}

TEST(ShakerTime, LeavesTheWatchdogAloneUntilAStopIsDone) {
    // GIVEN a running shaker that does not obey a stop
    TestServer server;
    ManualClock clock;
    const auto shaker = make_shaker(clock, periods(settings_for(server)));
    shaker->start([] { return true; }, {});
    static_cast<void>(clock.rest());
    ASSERT_TRUE(shaker->request({15.0, 1.0, 1.0}, 0));
    static_cast<void>(clock.rest());
    ASSERT_EQ(server.holding(kRun), 1);
    server.script([](const Request& request) {
        return request.writes(kRun) ? Answer{Answer::Kind::ignore_write, 0, {}} : Answer{};
    });
    const auto feeds = shaker->counters().feeds;
    const auto polled = polls(server);
    shaker->stop_now();
    // WHEN five seconds pass
    for (Time now = clock.rest(); now <= 5 * kSecond; now = clock.rest()) clock.set(now);
    // THEN the stop was written every 100 ms, at the first of them with the ramp and at once again
    // alone, it was read all the time, and not fed once
    EXPECT_EQ(shaker->counters().stops_written, 52U);
    EXPECT_EQ(polls(server) - polled, 25);
    EXPECT_EQ(shaker->counters().feeds, feeds);
    EXPECT_TRUE(shaker->stop_pending());
    shaker->shut_down();
}

TEST(ShakerTime, LeavesTheFirstTenthOfASecondAfterAnOutageToTheStop) {
    // GIVEN a shaker that shook when its cable was cut, ten minutes ago
    std::optional<TestServer> server(std::in_place);
    const int port = server->port();
    ManualClock clock;
    const auto shaker = make_shaker(clock, periods(settings_for(*server)));
    shaker->start([] { return true; }, {});
    static_cast<void>(clock.rest());
    ASSERT_TRUE(shaker->request({15.0, 1.0, 1.0}, 0));
    static_cast<void>(clock.rest());
    ASSERT_EQ(server->holding(kRun), 1);
    server.reset();
    for (Time now = clock.rest(); shaker->state() != LinkState::connecting; now = clock.rest())
        clock.set(now);
    shaker->stop_now();
    for (Time now = clock.rest(); now <= 600 * kSecond; now = clock.rest()) clock.set(now);
    // WHEN it is in again
    server.emplace(TestServer::Line::tcp, port);
    server->set_holding(kRun, 1);
    for (Time now = clock.rest(); shaker->counters().reconnects == 0; now = clock.rest())
        clock.set(now);
    const Time connected = clock.now();
    for (Time now = clock.rest(); now <= connected + 100 * kMillisecond; now = clock.rest())
        clock.set(now);
    // THEN the stop was written and read back, and nothing else within 100 ms
    EXPECT_FALSE(shaker->stop_pending());
    ASSERT_EQ(server->writes().size(), 1U);
    EXPECT_TRUE(server->writes().front().writes(kRun, 0));
    EXPECT_GE(shaker->reading().time, connected);
    // and then the watchdog has its own again, and nothing starts by itself
    for (Time now = clock.rest(); now <= connected + 3 * kSecond; now = clock.rest())
        clock.set(now);
    EXPECT_TRUE(server->saw([](const Request& r) { return r.writes(kWatchdog); }));
    EXPECT_EQ(addresses_written(*server), std::vector{kRun});
    EXPECT_EQ(server->holding(kRun), 0);
    shaker->shut_down();
}

TEST(ShakerTime, FeedsAtOnceAfterALostReply) {
    // GIVEN a shaker whose watchdog waits for the next feed when a reply is lost
    TestServer server;
    ManualClock clock;
    const auto shaker = make_shaker(clock, periods(settings_for(server)));
    shaker->start([] { return true; }, {});
    for (Time now = clock.rest(); now <= kSecond; now = clock.rest()) clock.set(now);
    server.script([](const Request& request) {
        return request.connection == 1 ? Answer{Answer::Kind::close, 0, {}} : Answer{};
    });
    server.forget();
    for (Time now = clock.rest(); shaker->counters().reconnects == 0; now = clock.rest())
        clock.set(now);
    // THEN it is fed on the new connection before the clock goes on
    EXPECT_TRUE(
        server.saw([](const Request& r) { return r.connection == 2 && r.writes(kWatchdog); }));
    shaker->shut_down();
}

}  // namespace
}  // namespace vibrig::drivers::test
