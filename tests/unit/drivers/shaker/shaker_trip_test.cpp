// A stop as fast as the controller can, and the timeout of its watchdog.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <thread>

#include "test_bench.hpp"

namespace vibrig::drivers::test {
namespace {

using Kind = Answer::Kind;
using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr ShakerSetPoint kSlow{15.0, 1.0, 60.0};
constexpr int kElsewhere = 10;  ///< a ramp time that does not lie beside run

[[nodiscard]] ShakerSettings apart(const TestServer& server) {
    ShakerSettings settings = settings_for(server);
    settings.registers.ramp_time.address = kElsewhere;
    return settings;
}

/// How long it took.
auto stop_of(Bench& bench) {
    const auto began = steady_clock::now();
    bench.shaker->stop_now();
    EXPECT_TRUE(bench.eventually([&] { return !bench.shaker->stop_pending(); }));
    return steady_clock::now() - began;
}

/// The first that is not the watchdog's: a feed may be under way when the stop is ordered.
Request first_write(const TestServer& server) {
    for (const Request& write : server.writes())
        if (write.address != kWatchdog) return write;
    ADD_FAILURE() << "nothing was written";
    return {};
}

TEST(ShakerTrip, RampZeroAndRunZeroAreOneWriteWhereTheyLieSideBySide) {
    TestServer server;
    Bench bench(settings_for(server));
    ASSERT_TRUE(bench.apply(kSlow));
    ASSERT_EQ(server.holding(kRampTime), 6000);
    server.forget();
    stop_of(bench);
    const Request write = first_write(server);
    EXPECT_EQ(write.address, kRampTime);
    EXPECT_EQ(write.values, (std::vector<std::uint16_t>{0, 0}));
    EXPECT_EQ(server.holding(kRampTime), 0);
    EXPECT_EQ(server.holding(kRun), 0);
    // AND the next set-point brings its own ramp
    ASSERT_TRUE(bench.apply({15.0, 1.0, 2.0}));
    EXPECT_EQ(server.holding(kRampTime), 200);
}

/// Else whoever acts on a reading does so before the interlock has seen it: an opened emergency
/// stop was an abort then, and no trip.
TEST(ShakerTrip, AReadingIsJudgedBeforeAnybodyActsOnIt) {
    TestServer server;
    RealClock clock;
    const auto shaker = make_shaker(clock, settings_for(server));
    std::atomic<int> judged{0}, early{0};
    std::atomic<Time> newest{0}, before{0};
    shaker->on_judging([&](const ShakerReading& reading) {
        if (shaker->reading().time >= reading.time) ++early;
        newest = reading.time;
        ++judged;
    });
    shaker->on_reading([&] {
        if (shaker->reading().time != newest.load()) before = newest.load();
    });
    // AND whoever hears of the link's state finds no reading that was not judged
    shaker->start([] { return true; },
                  [&](LinkState, const char*) {
                      if (shaker->reading().time > newest.load()) ++early;
                  });
    const auto deadline = steady_clock::now() + std::chrono::seconds(60);
    while (judged < 5 && steady_clock::now() < deadline)
        std::this_thread::sleep_for(milliseconds(2));
    shaker->shut_down();
    EXPECT_GE(judged, 5);
    EXPECT_EQ(early, 0);
    EXPECT_EQ(before, 0) << "and then it is the one that was";
}

TEST(ShakerTrip, APlannedEndKeepsItsRamp) {
    TestServer server;
    Bench bench(settings_for(server));
    ASSERT_TRUE(bench.apply(kSlow));
    ASSERT_TRUE(bench.apply({15.0, 0.0, 5.0}));
    EXPECT_EQ(server.holding(kRun), 0);
    EXPECT_EQ(server.holding(kRampTime), 500);
}

TEST(ShakerTrip, ADeviceThatTakesOneRegisterAtATimeGetsThemOneByOne) {
    TestServer server;
    Bench bench(settings_for(server));
    ASSERT_TRUE(bench.apply(kSlow));
    server.script([](const Request& request) {
        return request.writes_run() && request.count > 1 ? Answer{Kind::exception, 1, {}}
                                                         : Answer{};
    });
    server.forget();
    stop_of(bench);
    EXPECT_EQ(server.holding(kRampTime), 0);
    EXPECT_EQ(server.holding(kRun), 0);
    EXPECT_TRUE(bench.reaches(LinkState::running)) << "what was refused on the way is no fault";
}

[[nodiscard]] bool is_joint(const Request& request) {
    return request.writes_run() && request.count > 1;
}

/// Of a stop: one request for both, then run 0 alone at once, and the ramp.
void expect_run_zero_alone_after_one_joint_write(const TestServer& server) {
    std::vector<Request> writes = server.writes();
    std::erase_if(writes, [](const Request& write) {
        return write.address == kWatchdog || write.address == kWatchdogTimeout;
    });
    ASSERT_GE(writes.size(), 3U);
    EXPECT_TRUE(is_joint(writes[0]));
    EXPECT_EQ(std::ranges::count_if(writes, is_joint), 1);
    EXPECT_TRUE(writes[1].writes(kRampTime, 0));
    EXPECT_TRUE(writes[2].writes(kRun, 0));
    EXPECT_EQ(server.holding(kRun), 0);
    EXPECT_EQ(server.holding(kRampTime), 0);
}

TEST(ShakerTrip, AJointWriteThatIsSwallowedIsFollowedByRunZeroAlone) {
    TestServer server;
    ShakerSettings settings = settings_for(server);
    settings.response_timeout = kSecond;
    settings.backoff_min = 60 * kSecond;  // which the stop does not wait for
    settings.backoff_max = 60 * kSecond;
    Bench bench(settings);
    ASSERT_TRUE(bench.apply(kSlow));
    server.script([](const Request& request) {
        return is_joint(request) ? Answer{Kind::swallow, 0, {}} : Answer{};
    });
    server.forget();
    stop_of(bench);
    expect_run_zero_alone_after_one_joint_write(server);
    EXPECT_TRUE(bench.reaches(LinkState::running));
}

TEST(ShakerTrip, AJointWriteThatIsAcknowledgedAndIgnoredIsFollowedByRunZeroAlone) {
    TestServer server;
    ShakerSettings settings = settings_for(server);
    settings.backoff_min = 60 * kSecond;
    settings.backoff_max = 60 * kSecond;
    Bench bench(settings);
    ASSERT_TRUE(bench.apply(kSlow));
    server.script([](const Request& request) {
        return is_joint(request) ? Answer{Kind::ignore_write, 0, {}} : Answer{};
    });
    server.forget();
    stop_of(bench);
    expect_run_zero_alone_after_one_joint_write(server);
    EXPECT_TRUE(bench.reaches(LinkState::running));
    // AND the stop after it is as quick as it can be again
    server.script({});
    ASSERT_TRUE(bench.apply(kSlow));
    server.forget();
    stop_of(bench);
    EXPECT_TRUE(is_joint(first_write(server)));
}

TEST(ShakerTrip, AJointWriteThatCameToNothingIsNotTriedAgainOverReconnections) {
    for (const Kind joint : {Kind::swallow, Kind::ignore_write, Kind::exception, Kind::close}) {
        std::atomic<int> alone = 0;  // before the server, whose thread asks it to the end
        TestServer server;
        ShakerSettings settings = settings_for(server);
        settings.response_timeout = kSecond;
        Bench bench(settings);
        ASSERT_TRUE(bench.apply(kSlow));
        // GIVEN a device that does nothing of it, and ends the connection three times at run alone
        server.script([&, joint](const Request& request) {
            if (is_joint(request)) return Answer{joint, 1, {}};
            return request.writes_run() && ++alone <= 3 ? Answer{Kind::close, 0, {}} : Answer{};
        });
        server.forget();
        stop_of(bench);
        const auto writes = server.writes();
        EXPECT_EQ(std::ranges::count_if(writes, is_joint), 1) << static_cast<int>(joint);
        EXPECT_GE(bench.shaker->counters().reconnects, 3U);
        EXPECT_EQ(server.holding(kRun), 0);
        EXPECT_EQ(server.holding(kRampTime), 0);
    }
}

TEST(ShakerTrip, ARampThatIsSwallowedAfterAJointWriteIsNotTriedAgain) {
    TestServer server;
    Bench bench(settings_for(server));
    ASSERT_TRUE(bench.apply(kSlow));
    server.script([](const Request& request) {
        if (is_joint(request)) return Answer{Kind::ignore_write, 0, {}};
        return request.writes(kRampTime) ? Answer{Kind::swallow, 0, {}} : Answer{};
    });
    server.forget();
    stop_of(bench);
    EXPECT_EQ(std::ranges::count(addresses_written(server), kRampTime), 1);
    EXPECT_EQ(server.holding(kRun), 0);
}

TEST(ShakerTrip, RunZeroGoesOutWhateverBecomesOfTheRamp) {
    for (const Answer answer : {Answer{Kind::exception, 3, {}}, Answer{Kind::ignore_write, 0, {}},
                                Answer{Kind::close, 0, {}}, Answer{Kind::wrong_unit, 0, {}}}) {
        TestServer server;
        ShakerSettings settings = apart(server);
        settings.response_timeout = kSecond;  // a link that is lost before has no ramp to try
        Bench bench(settings);
        ASSERT_TRUE(bench.apply(kSlow));
        server.script([answer](const Request& request) {
            return request.writes(kElsewhere) ? answer : Answer{};
        });
        server.forget();
        stop_of(bench);
        EXPECT_EQ(server.holding(kRun), 0) << static_cast<int>(answer.kind);
        const auto written = addresses_written(server);
        EXPECT_EQ(std::ranges::count(written, kElsewhere), 1)
            << "one try: " << static_cast<int>(answer.kind);
    }
}

TEST(ShakerTrip, ARampThatIsNotAnsweredHoldsRunZeroUpFor100MillisecondsAtMost) {
    // GIVEN a response timeout of 5 s, and no answer to the ramp
    TestServer server;
    Bench bench(apart(server));
    ASSERT_TRUE(bench.apply(kSlow));
    server.script([](const Request& request) {
        return request.writes(kElsewhere) ? Answer{Kind::hang, 0, {}} : Answer{};
    });
    const auto took = stop_of(bench);
    EXPECT_EQ(server.holding(kRun), 0);
    EXPECT_GE(took, milliseconds(95));
    EXPECT_LT(took, milliseconds(2500)) << "half the response timeout, on a busy machine";
}

TEST(ShakerTrip, WaitsTheFullResponseTimeoutForEverythingElse) {
    // GIVEN a ramp that was not answered in its 100 ms
    std::atomic<bool> first = true;  // before the server, whose thread asks it to the end
    TestServer server;
    Bench bench(apart(server));
    ASSERT_TRUE(bench.apply(kSlow));
    server.script([&](const Request& request) {
        if (request.writes(kElsewhere) && first.exchange(false)) return Answer{Kind::hang, 0, {}};
        // WHEN run is answered late THEN it is waited for
        return request.writes_run() ? Answer{Kind::late, 0, milliseconds(300)} : Answer{};
    });
    stop_of(bench);
    EXPECT_EQ(bench.shaker->counters().timeouts, 1U);
}

TEST(WatchdogTimeout, IsLookedAtAllTheTimeAndAChangeIsSeen) {
    TestServer server;
    ShakerSettings settings = settings_for(server);
    settings.watchdog_period = 500 * kMillisecond;
    Bench bench(settings);
    ASSERT_TRUE(bench.apply({15.0, 1.0, 1.0}));
    ASSERT_TRUE(bench.eventually(
        [&] { return bench.shaker->reading().watchdog == WatchdogTimeout::kept; }));
    EXPECT_EQ(bench.shaker->reading().watchdog_timeout_s, 1.5);
    // WHEN another master writes 60 s, or 0
    for (const int value : {60'000, 0}) {
        const auto began = steady_clock::now();
        server.set_holding(kWatchdogTimeout, static_cast<std::uint16_t>(value));
        ASSERT_TRUE(bench.eventually(
            [&] { return bench.shaker->reading().watchdog == WatchdogTimeout::changed; }));
        EXPECT_LT(steady_clock::now() - began, std::chrono::seconds(3)) << "500 ms when not busy";
        ASSERT_TRUE(bench.eventually(
            [&] { return bench.shaker->reading().watchdog_timeout_s == 1e-3 * value; }));
        EXPECT_EQ(bench.shaker->state(), LinkState::degraded);
        EXPECT_FALSE(bench.request({15.0, 1.0, 1.0}));
        // THEN it stays so until a stop, after which it is what was written
        EXPECT_EQ(server.holding(kWatchdogTimeout), value);
        stop_of(bench);
        ASSERT_TRUE(bench.eventually(
            [&] { return bench.shaker->reading().watchdog == WatchdogTimeout::kept; }));
        EXPECT_EQ(server.holding(kWatchdogTimeout), 1500);
        EXPECT_TRUE(bench.reaches(LinkState::running));
    }
}

TEST(WatchdogTimeout, ThatItsRegisterRoundsToNothingIsNone) {
    // GIVEN a register of tens of seconds: 1.5 s are written, and read back, as 0
    TestServer server;
    ShakerSettings settings = settings_for(server);
    settings.watchdog_period = 500 * kMillisecond;
    settings.registers.watchdog_timeout.scale = 10;
    Bench bench(settings);
    EXPECT_TRUE(bench.eventually(
        [&] { return bench.shaker->reading().watchdog == WatchdogTimeout::changed; }));
    EXPECT_FALSE(bench.request({15.0, 1.0, 1.0}));
}

TEST(WatchdogTimeout, ThatIsSwallowedOrScaledOnTheWayIsSeen) {
    for (const auto kind : {Kind::ignore_write, Kind::exception}) {
        TestServer server;
        server.set_holding(kWatchdogTimeout, 15'000);
        server.script([kind](const Request& request) {
            return request.writes(kWatchdogTimeout) ? Answer{kind, 3, {}} : Answer{};
        });
        Bench bench(settings_for(server));
        if (kind == Kind::exception) {
            EXPECT_TRUE(bench.reaches(LinkState::degraded));
            EXPECT_EQ(bench.shaker->counters().feeds, 0U);
            continue;
        }
        EXPECT_TRUE(bench.eventually(
            [&] { return bench.shaker->reading().watchdog == WatchdogTimeout::changed; }));
    }
}

TEST(WatchdogTimeout, ARegisterThatCannotBeReadIsRefused) {
    ShakerSettings settings;
    settings.registers.watchdog_timeout.access = proto::Access::write;
    RealClock clock;
    EXPECT_THROW(static_cast<void>(make_shaker(clock, settings)), ShakerError);
}

}  // namespace
}  // namespace vibrig::drivers::test
