#include "drivers/shaker/shaker.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <thread>

#include "test_bench.hpp"

namespace vibrig::drivers::test {
namespace {

using Kind = Answer::Kind;

TEST(Shaker, WritesFrequencyRampAndAmplitudeBeforeItRuns) {
    // GIVEN a shaker at rest
    TestServer server;
    Bench bench(settings_for(server));
    // WHEN it is asked for 3.5 g at 15 Hz within 4 s
    ASSERT_TRUE(bench.apply({15.0, 3.5, 4.0}));
    // THEN the run register is written last, and all values are raw values of the map
    EXPECT_EQ(addresses_written(server), (std::vector{kFrequency, kRampTime, kAmplitude, kRun}));
    EXPECT_EQ(server.holding(0) << 16 | server.holding(1), 15000);
    EXPECT_EQ(server.holding(2) << 16 | server.holding(3), 35000);
    EXPECT_EQ(server.holding(4), 400);
    EXPECT_EQ(server.holding(5), 1);
    EXPECT_EQ(bench.shaker->counters().set_points_written, 1U);
}

TEST(Shaker, ReadsBackEachWriteBeforeTheNext) {
    TestServer server;
    Bench bench(settings_for(server), false);
    ASSERT_TRUE(bench.reaches(LinkState::running));
    server.forget();
    ASSERT_TRUE(bench.apply({15.0, 3.5, 4.0}));
    const auto requests = server.requests();
    int verified = 0;
    for (std::size_t i = 0; i + 1 < requests.size(); ++i) {
        if (!requests[i].is_write()) continue;
        EXPECT_EQ(requests[i + 1].function, 3);
        EXPECT_EQ(requests[i + 1].address, requests[i].address);
        EXPECT_EQ(requests[i + 1].count, requests[i].count);
        ++verified;
    }
    EXPECT_EQ(verified, 4);
}

TEST(Shaker, GivesTheReadingInEngineeringUnits) {
    TestServer server;
    Bench bench(settings_for(server));
    ASSERT_TRUE(bench.apply({15.0, 3.5, 4.0}));
    server.set_input(2, 0xfff1);  // before the one that is waited for: it may be read in between
    server.set_input(1, 5);
    ASSERT_TRUE(bench.eventually([&] { return bench.shaker->reading().fault == 5; }));
    const ShakerReading reading = bench.shaker->reading();
    EXPECT_DOUBLE_EQ(reading.frequency_hz, 15.0);
    EXPECT_DOUBLE_EQ(reading.amplitude_g, 3.5);
    EXPECT_DOUBLE_EQ(reading.measured_g, 3.5);
    EXPECT_EQ(reading.state, 2);
    EXPECT_TRUE(reading.running);
    EXPECT_TRUE(reading.emergency_stop_open);
    EXPECT_FALSE(reading.at_rest());
}

TEST(Shaker, PollsAllStatusInOneRequestPerTable) {
    TestServer server;
    Bench bench(settings_for(server), false);
    ASSERT_TRUE(bench.reaches(LinkState::running));
    server.forget();
    ASSERT_TRUE(server.saw([](const Request& r) { return r.function == 4; }));
    for (const Request& request : server.requests()) {
        EXPECT_EQ(request.address, 0);
        EXPECT_EQ(request.count, request.function == 3 ? 6 : 5);
    }
}

TEST(Shaker, LeavesTheFrequencyAloneWhileItDoesNotChange) {
    TestServer server;
    Bench bench(settings_for(server));
    ASSERT_TRUE(bench.apply({15.0, 1.0, 1.0}));
    server.forget();
    // WHEN only the amplitude changes THEN the frequency is not touched, and the run register
    // neither
    ASSERT_TRUE(bench.apply({15.0, 2.0, 1.0}));
    EXPECT_EQ(addresses_written(server), (std::vector{kRampTime, kAmplitude}));
    EXPECT_EQ(bench.shaker->counters().set_points_written, 2U);
}

TEST(Shaker, EndsARunWithAmplitudeZeroAndRunZero) {
    TestServer server;
    Bench bench(settings_for(server));
    ASSERT_TRUE(bench.apply({15.0, 1.0, 1.0}));
    server.forget();
    ASSERT_TRUE(bench.apply({15.0, 0.0, 2.0}));
    EXPECT_EQ(addresses_written(server), (std::vector{kRampTime, kAmplitude, kRun}));
    EXPECT_EQ(server.holding(kRun), 0);
    EXPECT_TRUE(bench.eventually([&] { return bench.shaker->reading().at_rest(); }));
}

TEST(Shaker, RunsAtZeroWhereThatIsAskedFor) {
    TestServer server;
    Bench bench(settings_for(server));
    ShakerSetPoint nothing{15.0, 0, 1.0};
    nothing.run_at_zero = true;
    ASSERT_TRUE(bench.apply(nothing));
    EXPECT_EQ(server.holding(kRun), 1);
    EXPECT_EQ(server.holding(kAmplitude) << 16 | server.holding(kAmplitude + 1), 0);
    // AND what another master makes of it is noticed
    server.set_holding(kAmplitude + 1, 200);
    EXPECT_TRUE(
        bench.eventually([&] { return bench.shaker->counters().read_back_mismatches == 1; }));
    ASSERT_TRUE(bench.eventually([&] { return bench.shaker->state() == LinkState::degraded; }));
}

TEST(Shaker, HangsUpUntilItIsTimeOrAStopIsOrdered) {
    TestServer server;
    Bench bench(settings_for(server));
    ASSERT_TRUE(bench.apply({15.0, 1.0, 1.0}));
    const auto connections = [&] {
        int highest = 0;
        for (const Request& request : server.requests())
            highest = std::max(highest, request.connection);
        return highest;
    };
    ASSERT_EQ(connections(), 1);
    // WHEN it hangs up for a while THEN nothing is asked or fed meanwhile
    RealClock clock;
    bench.shaker->hang_up_until(clock.now() + 3 * kSecond);
    ASSERT_TRUE(bench.reaches(LinkState::connecting));
    server.forget();
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    EXPECT_TRUE(server.requests().empty());
    // AND then it goes on by itself
    ASSERT_TRUE(bench.reaches(LinkState::running));
    EXPECT_EQ(connections(), 2);
    // WHEN a stop is ordered while it has hung up THEN that does not wait
    bench.shaker->hang_up_until(clock.now() + 1000 * kSecond);
    ASSERT_TRUE(bench.reaches(LinkState::connecting));
    server.forget();
    bench.shaker->stop_now();
    ASSERT_TRUE(server.saw([](const Request& r) { return r.writes(kRun, 0); }));
    ASSERT_TRUE(bench.eventually([&] { return !bench.shaker->stop_pending(); }));
    EXPECT_EQ(server.holding(kRun), 0);
}

TEST(Shaker, ComesDownWhateverTheFrequency) {
    // GIVEN a device that refuses another frequency in motion, as devices do
    TestServer server;
    Bench bench(settings_for(server));
    ASSERT_TRUE(bench.apply({15.0, 1.0, 1.0}));
    server.script([](const Request& request) {
        return request.writes(kFrequency) ? Answer{Kind::exception, 3, {}} : Answer{};
    });
    // WHEN it is commanded to come down, with a frequency that is not the present one
    server.forget();
    ASSERT_TRUE(bench.apply({20.0, 0.0, 1.0}));
    // THEN it does
    EXPECT_EQ(addresses_written(server), (std::vector{kRampTime, kAmplitude, kRun}));
    EXPECT_EQ(server.holding(kRun), 0);
    EXPECT_EQ(bench.shaker->counters().exceptions, 0U);
}

TEST(Shaker, ZeroesAnOldAmplitudeBeforeItChangesTheFrequency) {
    // GIVEN a device at rest that still holds the amplitude of a run that was stopped
    TestServer server;
    server.set_holding(kFrequency + 1, 15000);
    server.set_holding(kAmplitude + 1, 20000);
    Bench bench(settings_for(server));
    ASSERT_TRUE(bench.apply({20.0, 1.0, 1.0}));
    EXPECT_EQ(addresses_written(server),
              (std::vector{kAmplitude, kFrequency, kRampTime, kAmplitude, kRun}));
}

TEST(Shaker, DoesNotStartAgainADeviceThatTrippedWhileItRan) {
    TestServer server;
    Bench bench(settings_for(server));
    ASSERT_TRUE(bench.apply({15.0, 1.0, 1.0}));
    server.forget();
    // GIVEN a device that drops its run register while the next amplitude is written
    server.script([](const Request& request) {
        return request.writes(kRampTime) ? Answer{Kind::trip, 0, {}} : Answer{};
    });
    ASSERT_TRUE(bench.apply({15.0, 2.0, 1.0}));
    EXPECT_EQ(bench.shaker->state(), LinkState::degraded);
    EXPECT_EQ(server.holding(kRun), 0);
    for (const Request& write : server.writes()) EXPECT_FALSE(write.writes(kRun, 1));
}

TEST(Shaker, StaysDegradedAfterAMismatchUntilAStopIsReadBack) {
    // GIVEN a device that acknowledges an amplitude and does not take it
    TestServer server;
    server.script([](const Request& request) {
        return request.writes(kAmplitude) ? Answer{Kind::ignore_write, 0, {}} : Answer{};
    });
    Bench bench(settings_for(server));
    ASSERT_TRUE(bench.apply({15.0, 3.5, 4.0}));
    // THEN the shaker does not run, and says why
    ASSERT_TRUE(bench.reaches(LinkState::degraded));
    EXPECT_EQ(bench.shaker->counters().read_back_mismatches, 1U);
    EXPECT_EQ(addresses_written(server), (std::vector{kFrequency, kRampTime, kAmplitude}));
    EXPECT_NE(bench.said().back().second.find("amplitude reads back as 0.000000, expected 3.5"),
              std::string::npos)
        << bench.said().back().second;
    EXPECT_FALSE(bench.request({15.0, 1.0, 1.0}));
    // WHEN it is stopped THEN it is usable again
    bench.shaker->stop_now();
    EXPECT_TRUE(bench.reaches(LinkState::running));
}

// What another master writes while the table moves shows in the next look at the registers.
TEST(Shaker, NoticesWhatAnotherMasterChangesWhileItRuns) {
    struct Change {
        int address;
        const char* role;
    };
    for (const Change& change :
         {Change{kFrequency + 1, "frequency"}, Change{kAmplitude + 1, "amplitude"},
          Change{kRampTime, "ramp time"}, Change{kRun, "run"}}) {
        SCOPED_TRACE(change.role);
        TestServer server;
        Bench bench(settings_for(server));
        ASSERT_TRUE(bench.apply({15, 0.5, 1}));
        EXPECT_EQ(bench.shaker->counters().read_back_mismatches, 0U);
        const std::uint16_t own = server.holding(change.address);
        server.set_holding(change.address, own ^ 1U);
        ASSERT_TRUE(bench.reaches(LinkState::degraded));
        EXPECT_EQ(bench.shaker->counters().read_back_mismatches, 1U);
        EXPECT_NE(
            bench.said().back().second.find(std::string(change.role) + " was changed by another"),
            std::string::npos)
            << bench.said().back().second;
        bench.shaker->stop_now();
        EXPECT_TRUE(bench.reaches(LinkState::running));
    }
}

TEST(Shaker, LeavesADeviceThatStoppedByItselfToItsFault) {
    TestServer server;
    Bench bench(settings_for(server));
    ASSERT_TRUE(bench.apply({15, 0.5, 1}));
    server.set_input(1, 1);
    ASSERT_TRUE(bench.eventually([&] { return bench.shaker->reading().fault != 0; }));
    server.set_holding(kRun, 0);
    ASSERT_TRUE(bench.eventually([&] { return !bench.shaker->reading().running; }));
    EXPECT_EQ(bench.shaker->counters().read_back_mismatches, 0U);
}

TEST(Shaker, CountsAnExceptionAndKeepsTheLink) {
    TestServer server;
    for (int code = 1; code <= 6; ++code) {
        SCOPED_TRACE(code);
        server.script([=](const Request& request) {
            return request.writes(kFrequency) ? Answer{Kind::exception, code, {}} : Answer{};
        });
        Bench bench(settings_for(server));
        ASSERT_TRUE(bench.apply({10.0 + code, 3.5, 4.0}));
        ASSERT_TRUE(bench.reaches(LinkState::degraded));
        EXPECT_EQ(bench.shaker->counters().exceptions, 1U);
        EXPECT_EQ(bench.shaker->counters().reconnects, 0U);
        EXPECT_EQ(server.holding(kRun), 0);
        EXPECT_NE(
            bench.said().back().second.find("frequency refused: exception " + std::to_string(code)),
            std::string::npos);
    }
}

TEST(Shaker, RecoversAloneFromRefusedReadings) {
    TestServer server;
    Bench bench(settings_for(server));
    ASSERT_TRUE(bench.reaches(LinkState::running));
    server.script([](const Request& request) {
        return request.function == 4 ? Answer{Kind::exception, 6, {}} : Answer{};
    });
    // THEN the reading becomes invalid, without a new connection
    ASSERT_TRUE(bench.reaches(LinkState::degraded));
    ASSERT_TRUE(bench.eventually([&] { return !bench.shaker->reading().valid; }));
    server.script({});
    ASSERT_TRUE(bench.reaches(LinkState::running));
    EXPECT_TRUE(bench.eventually([&] { return bench.shaker->reading().valid; }));
    EXPECT_EQ(bench.shaker->counters().reconnects, 0U);
}

TEST(Shaker, RefusesValuesThatFitNoRegister) {
    TestServer server;
    Bench bench(settings_for(server));
    ASSERT_TRUE(bench.reaches(LinkState::running));
    constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    for (const double bad : {kNan, kInfinity, -1.0, 1e12}) {
        EXPECT_FALSE(bench.request({bad, 1.0, 1.0})) << bad;
        EXPECT_FALSE(bench.request({15.0, bad, 1.0})) << bad;
        EXPECT_FALSE(bench.request({15.0, 1.0, bad})) << bad;
    }
    EXPECT_FALSE(bench.shaker->busy());
    EXPECT_TRUE(addresses_written(server).empty());
}

TEST(Shaker, SetsTheWatchdogAndFeedsItWithChangingValues) {
    TestServer server;
    const ShakerSettings settings = settings_for(server);
    Bench bench(settings);
    ASSERT_TRUE(bench.eventually([&] { return bench.shaker->counters().feeds >= 5; }));
    EXPECT_EQ(server.holding(kWatchdogTimeout), 3 * settings.watchdog_period / kMillisecond);
    int last = -1;
    for (const Request& write : server.writes()) {
        if (!write.writes(kWatchdog)) continue;
        EXPECT_NE(write.values[0], last);
        last = write.values[0];
    }
}

TEST(Shaker, DoesNotFeedTheWatchdogUnlessItMay) {
    TestServer server;
    Bench bench(settings_for(server), false);
    const auto polls = [&] {
        const auto requests = server.requests();
        return std::count_if(requests.begin(), requests.end(),
                             [](const Request& r) { return r.function == 4; });
    };
    ASSERT_TRUE(bench.eventually([&] { return polls() >= 4; }));
    EXPECT_EQ(bench.shaker->counters().feeds, 0U);
    bench.may_feed = true;
    EXPECT_TRUE(server.saw([](const Request& r) { return r.writes(kWatchdog); }));
}

TEST(Shaker, NamesTheKeyOfAMissingWatchdog) {
    RealClock clock;
    ShakerSettings settings;
    settings.registers.watchdog.reset();
    try {
        static_cast<void>(make_shaker(clock, settings));
        FAIL();
    } catch (const ShakerError& error) {
        EXPECT_EQ(std::string(error.what()).find("shaker.registers.watchdog:"), 0U) << error.what();
    }
}

TEST(Shaker, RefusesSettingsThatCannotWork) {
    RealClock clock;
    const auto message = [&](const std::function<void(ShakerSettings&)>& spoil) {
        ShakerSettings settings;
        spoil(settings);
        try {
            static_cast<void>(make_shaker(clock, settings));
        } catch (const ShakerError& error) {
            return std::string(error.what());
        }
        return std::string("accepted");
    };
    EXPECT_EQ(message([](auto&) {}), "accepted");
    EXPECT_EQ(message([](auto& s) { s.registers.run.access = proto::Access::read; }),
              "shaker.registers.run.access: must allow writing, got read");
    EXPECT_EQ(message([](auto& s) { s.registers.amplitude.table = proto::RegisterTable::input; }),
              "shaker.registers.amplitude.table: must be holding, since it is written, got input");
    EXPECT_EQ(
        message([](auto& s) { s.registers.frequency.address = 65535; }),
        "shaker.registers.frequency.address: must leave room for 2 words below 65536, got 65535");
    EXPECT_EQ(message([](auto& s) { s.port = 0; }), "shaker.port: must be from 1 to 65535, got 0");
    EXPECT_EQ(message([](auto& s) { s.unit = 256; }),
              "shaker.unit: must be from 0 to 255, got 256");
    EXPECT_NE(
        message([](auto& s) { s.watchdog_period = 30 * kSecond; }).find("shaker.watchdog_period"),
        std::string::npos);
    EXPECT_NE(message([](auto& s) { s.poll_period = 0; }).find("shaker.poll_period"),
              std::string::npos);
}

}  // namespace
}  // namespace vibrig::drivers::test
