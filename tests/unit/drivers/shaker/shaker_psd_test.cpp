#include <gtest/gtest.h>

#include <algorithm>
#include <bit>

#include "test_bench.hpp"

namespace vibrig::drivers::test {
namespace {

constexpr int kBlock = 40, kPairs = 100;  // 400 words: four requests

ShakerSettings with_block(const TestServer& server) {
    ShakerSettings settings = settings_for(server);
    settings.watchdog_period = kSecond;  // a busy machine answers in half of it
    settings.registers.random.emplace().psd_block.emplace();
    settings.registers.random->psd_block->first.address = kBlock;
    settings.registers.random->psd_block->pairs = kPairs;
    return settings;
}
void show(TestServer& server, int at, float value) {
    const auto bits = std::bit_cast<std::uint32_t>(value);
    server.set_input(at, static_cast<std::uint16_t>(bits >> 16));
    server.set_input(at + 1, static_cast<std::uint16_t>(bits));
}
bool reads_block(const Request& request) {
    return request.function == 4 && request.address >= kBlock;
}
auto reads_of(const TestServer& server) {
    const auto all = server.requests();
    return std::ranges::count_if(all, reads_block);
}
bool answered(Bench& bench, std::uint64_t request) {
    return bench.eventually([&] { return bench.shaker->psd().request == request; });
}

TEST(ShakerPsd, IsReadInPartsAndWhole) {
    TestServer server;
    for (int i = 0; i < kPairs; ++i) {
        show(server, kBlock + 4 * i, 20.0F + static_cast<float>(i));
        show(server, kBlock + 4 * i + 2, 0.5F * static_cast<float>(i));
    }
    Bench bench(with_block(server));
    ASSERT_TRUE(bench.reaches(LinkState::running));
    EXPECT_EQ(reads_of(server), 0) << "nobody has asked";
    const auto request = bench.shaker->read_psd();
    ASSERT_GT(request, 0U);
    ASSERT_TRUE(answered(bench, request));
    const ShakerPsd psd = bench.shaker->psd();
    EXPECT_EQ(psd.why_not, "");
    ASSERT_EQ(psd.pairs.size(), 100U);
    EXPECT_EQ(psd.pairs[7], (std::array<double, 2>{27, 3.5}));
    EXPECT_EQ(psd.pairs[99], (std::array<double, 2>{119, 49.5}));
    // No request reads more than the protocol allows, and no pair is torn.
    for (const Request& one : server.requests()) {
        if (!reads_block(one)) continue;
        EXPECT_TRUE(one.count <= 124 && one.count % 4 == 0) << one.count;
    }
    EXPECT_EQ(reads_of(server), 4);
}

TEST(ShakerPsd, IsNoneWithoutRegisters) {
    TestServer server;
    Bench bench(settings_for(server));
    ASSERT_TRUE(bench.reaches(LinkState::running));
    EXPECT_EQ(bench.shaker->read_psd(), 0U);
}

TEST(ShakerPsd, IsNotReadWhileTheTableMoves) {
    TestServer server;
    Bench bench(with_block(server));
    ASSERT_TRUE(bench.apply({15.0, 9.0, 1.0}));
    const auto request = bench.shaker->read_psd();
    const auto polls = server.requests().size() + 40;
    ASSERT_TRUE(bench.eventually([&] { return server.requests().size() > polls; }));
    EXPECT_EQ(reads_of(server), 0);
    EXPECT_NE(bench.shaker->psd().request, request);
}

TEST(ShakerPsd, OneThatIsRefusedIsTriedAsOftenAsStated) {
    TestServer server;
    server.script([](const Request& r) {
        return reads_block(r) ? Answer{Answer::Kind::exception, 2} : Answer{};
    });
    Bench bench(with_block(server));
    const auto request = bench.shaker->read_psd();
    ASSERT_TRUE(answered(bench, request));
    EXPECT_TRUE(bench.shaker->psd().pairs.empty());
    EXPECT_NE(bench.shaker->psd().why_not.find("reading 124 registers from 40"), std::string::npos)
        << bench.shaker->psd().why_not;
    EXPECT_NE(bench.shaker->psd().why_not.find("tried 2 times"), std::string::npos);
    EXPECT_EQ(reads_of(server), 2);
    EXPECT_EQ(bench.shaker->counters().reconnects, 0U);
    ASSERT_TRUE(bench.reaches(LinkState::running)) << "it degrades nothing";
    ASSERT_TRUE(bench.apply({15.0, 9.0, 1.0}));
}

/// It costs its link, and no feed: half of a period is all that it is waited for.
TEST(ShakerPsd, SilenceEndsInHalfAFeedsPeriod) {
    TestServer server;
    server.script(
        [](const Request& r) { return reads_block(r) ? Answer{Answer::Kind::swallow} : Answer{}; });
    ShakerSettings settings = with_block(server);
    settings.watchdog_period = 400 * kMillisecond;
    Bench bench(settings);
    ASSERT_TRUE(bench.reaches(LinkState::running));
    const auto from = std::chrono::steady_clock::now();
    const auto request = bench.shaker->read_psd();
    ASSERT_TRUE(answered(bench, request));
    // Twice 0.2 s, not twice the 5 s of a response; what is left is a busy machine's.
    EXPECT_LT(std::chrono::steady_clock::now() - from, std::chrono::seconds(3));
    EXPECT_NE(bench.shaker->psd().why_not, "");
    // The second time after it has said so.
    EXPECT_TRUE(bench.eventually([&] { return bench.shaker->counters().reconnects == 2; }))
        << bench.shaker->counters().reconnects;
    ASSERT_TRUE(bench.reaches(LinkState::running));
}

TEST(ShakerPsd, AStopDoesNotWaitForIt) {
    TestServer server;
    server.script(
        [](const Request& r) { return reads_block(r) ? Answer{Answer::Kind::swallow} : Answer{}; });
    ShakerSettings settings = with_block(server);
    settings.watchdog_period = 8 * kSecond;
    Bench bench(settings);
    static_cast<void>(bench.shaker->read_psd());
    ASSERT_TRUE(server.saw(reads_block));
    const auto from = std::chrono::steady_clock::now();
    bench.shaker->stop_now();
    ASSERT_TRUE(server.saw([](const Request& r) { return r.writes_run(); }));
    // Not after the 4 s for which a part is waited for; what is left is a busy machine's.
    EXPECT_LT(std::chrono::steady_clock::now() - from, std::chrono::seconds(2));
}

}  // namespace
}  // namespace vibrig::drivers::test
