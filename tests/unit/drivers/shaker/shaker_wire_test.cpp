#include <fcntl.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/resource.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <ostream>

#include "test_bench.hpp"

namespace vibrig::drivers::test {
namespace {

using Kind = Answer::Kind;

struct WireFault {
    Kind kind;
    const char* name;
    std::uint64_t ShakerCounters::*counter;
};

void PrintTo(const WireFault& fault, std::ostream* out) { *out << fault.name; }

/// The link must be given up after each of these: the next reply could belong to this request.
class ShakerWire : public testing::TestWithParam<WireFault> {};

TEST_P(ShakerWire, GivesTheLinkUpAndConnectsAgain) {
    // GIVEN a running link and a device that spoils one reply to a read
    std::atomic<bool> spoiled = false;  // before the server, whose thread asks it to the end
    TestServer server;
    ShakerSettings settings = settings_for(server);
    const bool times_out = GetParam().kind == Kind::hang || GetParam().kind == Kind::late;
    if (times_out) settings.response_timeout = 200 * kMillisecond;
    Bench bench(settings);
    ASSERT_TRUE(bench.reaches(LinkState::running));
    server.script([&](const Request& request) {
        if (request.function != 3 || spoiled.exchange(true)) return Answer{};
        return Answer{GetParam().kind, 0, std::chrono::milliseconds(300)};
    });
    // THEN it is counted for what it was, and the next request goes over a new connection
    ASSERT_TRUE(server.saw([](const Request& r) { return r.connection == 2 && r.function == 4; }));
    ASSERT_TRUE(bench.reaches(LinkState::running));
    const ShakerCounters counters = bench.shaker->counters();
    EXPECT_GE(counters.*GetParam().counter, 1U);
    // A busy machine may be late for a short timeout more than once.
    if (!times_out) {
        EXPECT_EQ(counters.timeouts + counters.wrong_replies + counters.lost, 1U);
        EXPECT_EQ(counters.reconnects, 1U);
    }
    EXPECT_EQ(counters.exceptions, 0U);
    EXPECT_LE(counters.replies + 1, counters.requests);
}

INSTANTIATE_TEST_SUITE_P(
    Faults, ShakerWire,
    testing::Values(
        WireFault{Kind::hang, "NoReply", &ShakerCounters::timeouts},
        WireFault{Kind::late, "LateReply", &ShakerCounters::timeouts},
        WireFault{Kind::wrong_transaction, "WrongTransaction", &ShakerCounters::wrong_replies},
        WireFault{Kind::wrong_function, "WrongFunction", &ShakerCounters::wrong_replies},
        WireFault{Kind::twice, "SecondReply", &ShakerCounters::wrong_replies},
        WireFault{Kind::wrong_length, "WrongLength", &ShakerCounters::wrong_replies},
        WireFault{Kind::half_then_close, "HalfAReply", &ShakerCounters::lost},
        WireFault{Kind::close, "Close", &ShakerCounters::lost}),
    [](const auto& fault) { return fault.param.name; });

TEST(ShakerWire, ReadsRepliesOneByteAtATime) {
    TestServer server;
    server.script([](const Request&) {
        return Answer{Kind::bytewise, 0, std::chrono::milliseconds(1)};
    });
    Bench bench(settings_for(server));
    ASSERT_TRUE(bench.apply({15.0, 3.5, 4.0}));
    EXPECT_EQ(bench.shaker->counters().set_points_written, 1U);
    EXPECT_EQ(bench.shaker->counters().reconnects, 0U);
}

TEST(ShakerWire, EndsAReplyThatTricklesBeyondTheTimeout) {
    // GIVEN bytes that come one by one, each within the response timeout, all together far beyond
    // it
    TestServer server;
    ShakerSettings settings = settings_for(server);
    settings.response_timeout = 100 * kMillisecond;
    server.script([](const Request&) {
        return Answer{Kind::bytewise, 0, std::chrono::milliseconds(40)};
    });
    Bench bench(settings);
    // THEN that is a timeout
    EXPECT_TRUE(bench.eventually([&] { return bench.shaker->counters().timeouts >= 1; }));
    EXPECT_FALSE(bench.shaker->reading().valid);
}

TEST(ShakerWire, ForgetsTheReadingOfASilentDevice) {
    TestServer server;
    ShakerSettings settings = settings_for(server);
    settings.response_timeout = 60 * kSecond;
    Bench bench(settings);
    ASSERT_TRUE(bench.eventually([&] { return bench.shaker->reading().valid; }));
    server.script([](const Request&) { return Answer{Kind::hang, 0, {}}; });
    // THEN its last reading ends to be valid, although the request in flight has not timed out yet
    ASSERT_TRUE(bench.eventually([&] { return !bench.shaker->reading().valid; }));
    EXPECT_EQ(bench.shaker->counters().timeouts, 0U);
    EXPECT_FALSE(bench.shaker->reading().at_rest());
}

TEST(ShakerWire, WaitsForAServerThatIsNotThereYet) {
    // GIVEN a port where nobody listens
    int port = 0;
    {
        TestServer gone;
        port = gone.port();
    }
    ShakerSettings settings;
    settings.port = port;
    settings.backoff_min = 2 * kMillisecond;
    settings.backoff_max = 20 * kMillisecond;
    Bench bench(settings);
    ASSERT_TRUE(bench.eventually([&] { return !bench.said().empty(); }));
    EXPECT_EQ(bench.said().front().first, LinkState::connecting);
    EXPECT_NE(bench.said().front().second.find("Connection refused"), std::string::npos);
    EXPECT_FALSE(bench.request({15.0, 1.0, 1.0}));
    // WHEN it comes THEN it is used, and there was one line per change
    TestServer server(TestServer::Line::tcp, port);
    ASSERT_TRUE(bench.reaches(LinkState::running));
    EXPECT_EQ(bench.said().size(), 2U);
}

TEST(ShakerWire, TakesAHostName) {
    TestServer server;
    ShakerSettings settings = settings_for(server);
    settings.host = "localhost";
    Bench bench(settings);
    EXPECT_TRUE(bench.reaches(LinkState::running));
}

TEST(ShakerWire, EndsWhileItConnects) {
    // GIVEN a listener whose queue is full, so that connecting hangs
    const int listener = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    auto* const generic = reinterpret_cast<sockaddr*>(&address);
    ASSERT_EQ(::bind(listener, generic, size), 0);
    ASSERT_EQ(::listen(listener, 0), 0);
    ASSERT_EQ(::getsockname(listener, generic, &size), 0);
    std::vector<int> fillers;
    for (int i = 0; i < 4; ++i) {
        fillers.push_back(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
        ::connect(fillers.back(), generic, size);
    }
    ShakerSettings settings;
    settings.port = ntohs(address.sin_port);
    settings.response_timeout = 60 * kSecond;
    const auto began = std::chrono::steady_clock::now();
    {
        Bench bench(settings);
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    EXPECT_LT(std::chrono::steady_clock::now() - began, std::chrono::seconds(30));
    for (const int filler : fillers) ::close(filler);
    ::close(listener);
}

TEST(ShakerWire, SaysWhenDescriptorsAreBeyondSelect) {
    TestServer server;
    const ShakerSettings settings = settings_for(server);
    rlimit limit{};
    ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &limit), 0);
    if (limit.rlim_cur < FD_SETSIZE + 64)
        GTEST_SKIP() << "at most " << limit.rlim_cur << " open files here";
    // GIVEN a process with all descriptors below the limit of select() in use
    std::vector<int> fillers;
    do {
        fillers.push_back(::open("/dev/null", O_RDONLY | O_CLOEXEC));
        ASSERT_GE(fillers.back(), 0);
    } while (fillers.back() < FD_SETSIZE);
    {
        Bench bench(settings);
        // THEN the shaker does not touch them, and says so
        ASSERT_TRUE(bench.reaches(LinkState::fault));
        EXPECT_NE(bench.said().front().second.find("is not below 1024"), std::string::npos);
        // WHEN some are closed THEN it goes on
        for (std::size_t i = 0; i < 8; ++i) ::close(fillers[i]);
        fillers.erase(fillers.begin(), fillers.begin() + 8);
        EXPECT_TRUE(bench.reaches(LinkState::running));
    }
    for (const int filler : fillers) ::close(filler);
}

}  // namespace
}  // namespace vibrig::drivers::test
