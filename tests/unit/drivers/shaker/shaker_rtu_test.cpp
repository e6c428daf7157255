#include <gtest/gtest.h>

#include <atomic>
#include <ostream>

#include "test_bench.hpp"

namespace vibrig::drivers::test {
namespace {

using Kind = Answer::Kind;

TEST(ShakerRtu, WritesAndReadsBackOverASerialLine) {
    TestServer server(TestServer::Line::rtu);
    Bench bench(settings_for(server));
    ASSERT_TRUE(bench.apply({15.0, 3.5, 4.0}));
    EXPECT_EQ(addresses_written(server), (std::vector{kFrequency, kRampTime, kAmplitude, kRun}));
    EXPECT_DOUBLE_EQ(bench.shaker->reading().measured_g, 3.5);
    bench.shaker->stop_now();
    ASSERT_TRUE(bench.eventually([&] { return !bench.shaker->stop_pending(); }));
    EXPECT_EQ(server.holding(kRun), 0);
}

struct RtuFault {
    Kind kind;
    const char* name;
    std::uint64_t ShakerCounters::*counter;
};
void PrintTo(const RtuFault& fault, std::ostream* out) { *out << fault.name; }
class ShakerRtuWire : public testing::TestWithParam<RtuFault> {};

TEST_P(ShakerRtuWire, OpensTheLineAgain) {
    std::atomic<bool> spoiled = false;  // before the server, whose thread asks it to the end
    TestServer server(TestServer::Line::rtu);
    ShakerSettings settings = settings_for(server);
    const bool times_out = GetParam().kind == Kind::hang;
    if (times_out) settings.response_timeout = 300 * kMillisecond;
    Bench bench(settings);
    ASSERT_TRUE(bench.reaches(LinkState::running));
    server.script([&](const Request& request) {
        return request.function == 3 && !spoiled.exchange(true) ? Answer{GetParam().kind, 0, {}}
                                                                : Answer{};
    });
    ASSERT_TRUE(bench.eventually([&] { return bench.shaker->counters().reconnects >= 1; }));
    ASSERT_TRUE(bench.reaches(LinkState::running));
    EXPECT_GE(bench.shaker->counters().*GetParam().counter, 1U);
    // A busy machine may be late for a short timeout more than once.
    if (!times_out) {
        EXPECT_EQ(bench.shaker->counters().reconnects, 1U);
    }
}

INSTANTIATE_TEST_SUITE_P(
    Faults, ShakerRtuWire,
    testing::Values(RtuFault{Kind::hang, "NoReply", &ShakerCounters::timeouts},
                    RtuFault{Kind::damaged, "WrongChecksum", &ShakerCounters::wrong_replies},
                    RtuFault{Kind::twice, "SecondReply", &ShakerCounters::wrong_replies},
                    RtuFault{Kind::wrong_unit, "WrongUnit", &ShakerCounters::wrong_replies}),
    [](const auto& fault) { return fault.param.name; });

TEST(ShakerRtu, SendsAStopAsSoonAsTheLineIsFree) {
    // GIVEN a device that does not answer one request
    std::atomic<bool> hung = false;  // before the server, whose thread asks it to the end
    TestServer server(TestServer::Line::rtu);
    ShakerSettings settings = settings_for(server);
    settings.response_timeout = kSecond;
    Bench bench(settings);
    ASSERT_TRUE(bench.apply({15.0, 3.5, 4.0}));
    server.script([&](const Request& request) {
        return !request.is_write() && !hung.exchange(true) ? Answer{Kind::hang, 0, {}} : Answer{};
    });
    ASSERT_TRUE(bench.eventually([&] { return hung.load(); }));
    server.forget();
    bench.shaker->stop_now();
    // THEN the stop is the first that is sent after its timeout
    ASSERT_TRUE(bench.eventually([&] { return !bench.shaker->stop_pending(); }));
    EXPECT_TRUE(server.requests().front().writes(kRun, 0));
    EXPECT_GE(bench.shaker->counters().timeouts, 1U);
}

TEST(ShakerRtu, WaitsForADeviceThatIsNotThere) {
    ShakerSettings settings;
    settings.transport = ShakerSettings::Transport::rtu;
    settings.device = "/dev/vibrig-no-such-line";
    settings.backoff_min = 2 * kMillisecond;
    Bench bench(settings);
    ASSERT_TRUE(bench.eventually([&] { return !bench.said().empty(); }));
    EXPECT_EQ(bench.said().front().first, LinkState::connecting);
    EXPECT_NE(bench.said().front().second.find("No such file"), std::string::npos);
}

}  // namespace
}  // namespace vibrig::drivers::test
