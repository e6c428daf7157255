#include "proto/guard_words.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace vibrig::proto {
namespace {

TEST(GuardWords, ComeBackAsTheyWere) {
    const DaemonWord daemon{
        7, {1, 2, 3, std::numeric_limits<std::uint64_t>::max()}, true, false, true, 9.25, 4};
    EXPECT_EQ(decode_daemon_word(encode(daemon)), daemon);
    const GuardWord guard{
        7, GuardCause::stop_disobeyed, 3, true, true, false, true, false, 12.5, {"1.2.3"}};
    EXPECT_EQ(decode_guard_word(encode(guard)), guard);
}

TEST(GuardWords, OneIsNotTakenForTheOther) {
    EXPECT_FALSE(decode_guard_word(encode(DaemonWord{})));
    EXPECT_FALSE(decode_daemon_word(encode(GuardWord{})));
    std::array<std::uint8_t, kDaemonWordBytes> padded{};
    const auto guard = encode(GuardWord{});
    std::copy(guard.begin(), guard.end(), padded.begin());
    EXPECT_FALSE(decode_daemon_word(padded));
}

TEST(GuardWords, AnotherLengthIsRefused) {
    const auto bytes = encode(DaemonWord{});
    const std::span<const std::uint8_t> all(bytes);
    for (std::size_t size = 0; size < all.size(); ++size)
        EXPECT_FALSE(decode_daemon_word(all.first(size))) << size;
}

TEST(GuardWords, ALevelThatIsNoLevelIsRefused) {
    for (const double level : {-1.0, std::numeric_limits<double>::quiet_NaN(),
                               std::numeric_limits<double>::infinity()}) {
        DaemonWord daemon;
        daemon.level_g = level;
        EXPECT_FALSE(decode_daemon_word(encode(daemon))) << level;
        GuardWord guard;
        guard.table_g = level;
        EXPECT_FALSE(decode_guard_word(encode(guard))) << level;
    }
}

TEST(GuardWords, ARatioThatIsNoneIsRefused) {
    for (const double ratio : {0.5, -1.0, 1001.0, std::numeric_limits<double>::quiet_NaN()}) {
        DaemonWord daemon;
        daemon.platform_ratio = ratio;
        EXPECT_FALSE(decode_daemon_word(encode(daemon))) << ratio;
    }
}

TEST(GuardWords, AVersionThatIsNoTextIsRefused) {
    GuardWord guard;
    guard.version = {"1.2\n"};
    EXPECT_FALSE(decode_guard_word(encode(guard)));
    guard.version.fill('1');
    EXPECT_FALSE(decode_guard_word(encode(guard))) << "it has no end";
}

TEST(GuardWords, FlagsAndCausesThatDoNotExistAreRefused) {
    auto daemon = encode(DaemonWord{});
    daemon[4] = 8;
    EXPECT_FALSE(decode_daemon_word(daemon));
    auto guard = encode(GuardWord{});
    guard[6] = static_cast<std::uint8_t>(GuardCause::stop_disobeyed) + 1;
    EXPECT_FALSE(decode_guard_word(guard));
}

}  // namespace
}  // namespace vibrig::proto
