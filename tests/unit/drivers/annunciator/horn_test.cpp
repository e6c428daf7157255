#include "drivers/annunciator/horn.hpp"

#include <gtest/gtest.h>

#include "coil_server.hpp"
#include "scripts.hpp"

namespace vibrig::drivers::test {
namespace {

constexpr Time kHalf = kSecond / 2;

TEST(HornPattern, EachIsDistinguishedFromTheOthersByEar) {
    // Share of 20 s in which the horn sounds, and how often it begins to.
    struct Heard {
        int halves = 0, starts = 0;
    };
    const auto listen = [](HornPattern pattern) {
        Heard heard;
        bool before = false;
        for (Time t = 0; t < 20 * kSecond; t += kHalf) {
            const bool on = horn_sounds(pattern, t);
            heard.halves += on ? 1 : 0;
            heard.starts += on && !before ? 1 : 0;
            before = on;
        }
        return heard;
    };
    EXPECT_EQ(listen(HornPattern::none).halves, 0);
    EXPECT_EQ(listen(HornPattern::alarm).halves, 2);
    EXPECT_EQ(listen(HornPattern::alarm).starts, 2);
    EXPECT_EQ(listen(HornPattern::abort).halves, 20);
    EXPECT_EQ(listen(HornPattern::abort).starts, 10);
    EXPECT_EQ(listen(HornPattern::disobeyed).halves, 40);
    EXPECT_EQ(listen(HornPattern::disobeyed).starts, 1);
}

class HornOnTheWire : public testing::Test {
  protected:
    void SetUp() override {
        if (!have_pymodbus()) GTEST_SKIP() << "python3-pymodbus is not installed";
    }
    static HornSettings settings(const CoilServer& server) {
        HornSettings settings;
        settings.host = "127.0.0.1";
        settings.port = server.port();
        settings.horn_coil = 3;
        settings.lamp_coil = 4;
        settings.response_timeout = 5 * kSecond;
        return settings;
    }
};

TEST_F(HornOnTheWire, ADisobeyedStopSoundsWithoutAPauseAndIsConfirmed) {
    CoilServer server("honest");
    Horn horn(settings(server));
    for (Time t = 0; t < 5 * kSecond; t += kHalf)
        ASSERT_TRUE(horn.show(HornPattern::disobeyed, t)) << horn.note();
    ASSERT_TRUE(horn.show(HornPattern::none, 5 * kSecond));
    ASSERT_TRUE(horn.show(HornPattern::none, 6 * kSecond));
    // THEN each coil went on once and off once, and nothing else was written
    EXPECT_TRUE(eventually([&] { return server.lines().size() == 4; }));
    EXPECT_EQ(server.lines(),
              (std::vector<std::string>{"coil 3 1", "coil 4 1", "coil 3 0", "coil 4 0"}));
}

TEST_F(HornOnTheWire, AnAbortSoundsEveryOtherSecond) {
    CoilServer server("honest");
    Horn horn(settings(server));
    for (Time t = 0; t < 6 * kSecond; t += kHalf)
        ASSERT_TRUE(horn.show(HornPattern::abort, t)) << horn.note();
    EXPECT_TRUE(eventually([&] { return server.count("coil 3 0") == 3; }));
    EXPECT_EQ(server.count("coil 3 1"), 3u);
    EXPECT_EQ(server.count("coil 4 1"), 1u);
}

TEST_F(HornOnTheWire, AHornThatAcknowledgesAndStaysSilentIsFoundByItsReadBack) {
    CoilServer server("deaf");
    Horn horn(settings(server));
    ASSERT_TRUE(horn.show(HornPattern::none, 0));
    EXPECT_FALSE(horn.show(HornPattern::disobeyed, kHalf));
    EXPECT_NE(horn.note().find("the lamp (coil 4) was switched on and reads back off"),
              std::string::npos)
        << horn.note();
    // THEN it is commanded again, every time
    EXPECT_FALSE(horn.show(HornPattern::disobeyed, 2 * kHalf));
    EXPECT_TRUE(eventually([&] { return server.count("coil 3 1") == 2; }));
    EXPECT_TRUE(horn.show(HornPattern::none, 3 * kHalf)) << "off it is as commanded";
}

TEST_F(HornOnTheWire, AHornThatRefusesIsReportedWithItsException) {
    CoilServer server("refuses");
    Horn horn(settings(server));
    EXPECT_FALSE(horn.show(HornPattern::abort, 0));
    EXPECT_NE(horn.note().find("exception"), std::string::npos) << horn.note();
}

TEST_F(HornOnTheWire, ADeviceThatNeverAnswersTakesItsTimeoutAndNoMore) {
    CoilServer server("mute");
    auto mute = settings(server);
    mute.response_timeout = 200 * kMillisecond;
    Horn horn(mute);
    EXPECT_FALSE(horn.show(HornPattern::abort, 0));
    EXPECT_NE(horn.note().find("no complete reply"), std::string::npos) << horn.note();
    // THEN it is sought again after a second, not before
    EXPECT_FALSE(horn.show(HornPattern::abort, kHalf));
    EXPECT_FALSE(horn.show(HornPattern::abort, 2 * kSecond));
}

TEST_F(HornOnTheWire, AnotherMasterMaySoundTheSameHorn) {
    // GIVEN two that share it
    CoilServer server("honest");
    Horn daemon(settings(server)), guard(settings(server));
    ASSERT_TRUE(daemon.show(HornPattern::disobeyed, 0));
    ASSERT_TRUE(guard.show(HornPattern::disobeyed, 0));
    // WHEN one has done and goes on saying nothing
    ASSERT_TRUE(guard.show(HornPattern::none, kSecond));
    // THEN the other sounds it again, and is not silenced any more
    ASSERT_TRUE(daemon.show(HornPattern::disobeyed, kSecond));
    ASSERT_TRUE(guard.show(HornPattern::none, 2 * kSecond)) << "no failure of this one's";
    ASSERT_TRUE(daemon.show(HornPattern::disobeyed, 2 * kSecond));
    EXPECT_TRUE(eventually([&] { return server.count("coil 3 1") >= 2; }));
    EXPECT_EQ(server.count("coil 3 0"), 1u);
    EXPECT_EQ(server.count("coil 3 1"), 2u);
}

}  // namespace
}  // namespace vibrig::drivers::test
