// While a rig is commissioned nothing is written to its shaker's controller but a stop.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <thread>

#include "test_bench.hpp"

namespace vibrig::drivers::test {
namespace {

/// Whatever is not one of the functions that read.
long writes(const TestServer& server) {
    const auto all = server.requests();
    return std::ranges::count_if(all, [](const Request& r) {
        return r.function != 1 && r.function != 2 && r.function != 3 && r.function != 4 &&
               r.function != 17;
    });
}

/// Two readings on, what was under way before is over: there is one request at a time.
bool two_readings_on(Bench& bench) {
    for (int i = 0; i < 2; ++i) {
        const auto then = bench.shaker->reading().time;
        if (!bench.eventually([&] { return bench.shaker->reading().time > then; })) return false;
    }
    return true;
}

/// 25 feeds would have been due.
void half_a_second() { std::this_thread::sleep_for(std::chrono::milliseconds(500)); }

TEST(ShakerReadOnly, NothingIsWrittenAndAllIsRead) {
    TestServer server;
    Bench bench(settings_for(server));
    ASSERT_TRUE(bench.eventually([&] { return bench.shaker->counters().feeds > 2; }));
    bench.shaker->read_only(true);
    ASSERT_TRUE(two_readings_on(bench));
    const auto before = writes(server);
    const auto then = bench.shaker->reading().time;
    half_a_second();
    EXPECT_EQ(writes(server), before);
    EXPECT_TRUE(bench.eventually([&] {
        const auto reading = bench.shaker->reading();
        return reading.valid && reading.time > then;
    }));
    EXPECT_FALSE(bench.request({15.0, 1.0, 1.0})) << "and nothing is shaken";
    bench.shaker->read_only(false);
    EXPECT_TRUE(bench.eventually([&] { return writes(server) > before; }));
}

TEST(ShakerReadOnly, ALinkThatIsMadeMeanwhileIsGivenNoTimeout) {
    TestServer server;
    auto settings = settings_for(server);
    Bench bench(settings);
    ASSERT_TRUE(bench.reaches(LinkState::running));
    bench.shaker->read_only(true);
    ASSERT_TRUE(two_readings_on(bench));
    const auto before = writes(server);
    const auto reconnects = bench.shaker->counters().reconnects;
    server.script(
        [](const Request& r) { return r.function == 3 ? Answer{Answer::Kind::close} : Answer{}; });
    ASSERT_TRUE(bench.eventually([&] { return bench.shaker->counters().reconnects > reconnects; }));
    server.script({});
    ASSERT_TRUE(bench.reaches(LinkState::running));
    half_a_second();
    EXPECT_EQ(writes(server), before);
    bench.shaker->read_only(false);
    EXPECT_TRUE(bench.eventually(
        [&] { return bench.shaker->reading().watchdog == WatchdogTimeout::kept; }));
}

TEST(ShakerReadOnly, AStopIsWrittenAtOnceAsEver) {
    TestServer server;
    Bench bench(settings_for(server));
    ASSERT_TRUE(bench.apply({15.0, 9.0, 1.0}));
    bench.shaker->read_only(true);
    bench.shaker->stop_now();
    ASSERT_TRUE(bench.eventually([&] { return !bench.shaker->stop_pending(); }));
    EXPECT_EQ(server.holding(kRun), 0);
    // Afterwards it is read only again.
    ASSERT_TRUE(two_readings_on(bench));
    const auto before = writes(server);
    half_a_second();
    EXPECT_EQ(writes(server), before);
}

}  // namespace
}  // namespace vibrig::drivers::test
