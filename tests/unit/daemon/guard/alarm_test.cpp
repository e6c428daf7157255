#include "daemon/guard/alarm.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "coil_server.hpp"
#include "drivers/annunciator/horn.hpp"
#include "scripts.hpp"
#include "tests/unit/support/host_names.hpp"

namespace vibrig::guard {
namespace {

using drivers::kSecond;
using drivers::Time;
using drivers::test::CoilServer;
using drivers::test::dead;
using drivers::test::eventually;
using drivers::test::Script;

constexpr Time kHalf = kSecond / 2;

// People know the daemon's tunes: the guard's are those, though not a line of it is the same.
TEST(Tune, SoundsAsTheDaemonsDo) {
    for (Time t = 0; t < 20 * kSecond; t += kSecond / 8) {
        EXPECT_EQ(sounds(Tune::none, t), drivers::horn_sounds(drivers::HornPattern::none, t));
        EXPECT_EQ(sounds(Tune::stop, t), drivers::horn_sounds(drivers::HornPattern::abort, t));
        EXPECT_EQ(sounds(Tune::disobeyed, t),
                  drivers::horn_sounds(drivers::HornPattern::disobeyed, t));
    }
}

class CoilsOnTheWire : public testing::Test {
  protected:
    void SetUp() override {
        if (!drivers::test::have_pymodbus()) GTEST_SKIP() << "python3-pymodbus is not installed";
    }
    static AlarmSettings settings(const CoilServer& server) {
        AlarmSettings settings;
        settings.host = "127.0.0.1";
        settings.port = server.port();
        settings.horn_coil = 3;
        settings.lamp_coil = 4;
        settings.wait_ms = 5000;  // the machine may be busy
        return settings;
    }
};

TEST_F(CoilsOnTheWire, ADisobeyedStopSoundsWithoutAPauseAndIsConfirmed) {
    const CoilServer server("honest");
    Coils coils(settings(server));
    for (Time t = kSecond; t < 6 * kSecond; t += kHalf)
        ASSERT_TRUE(coils.show(Tune::disobeyed, t)) << coils.note();
    ASSERT_TRUE(coils.show(Tune::none, 6 * kSecond));
    ASSERT_TRUE(coils.show(Tune::none, 7 * kSecond));
    EXPECT_TRUE(eventually([&] { return server.lines().size() == 4; }));
    EXPECT_EQ(server.lines(),
              (std::vector<std::string>{"coil 3 1", "coil 4 1", "coil 3 0", "coil 4 0"}));
}

TEST_F(CoilsOnTheWire, AHornThatAcknowledgesAndStaysSilentIsFoundByItsReadBack) {
    const CoilServer server("deaf");
    Coils coils(settings(server));
    ASSERT_TRUE(coils.show(Tune::none, kSecond)) << coils.note();
    EXPECT_FALSE(coils.show(Tune::disobeyed, 2 * kSecond));
    EXPECT_NE(coils.note().find("was switched on and reads back off"), std::string::npos)
        << coils.note();
    EXPECT_FALSE(coils.show(Tune::disobeyed, 3 * kSecond));
    EXPECT_TRUE(eventually([&] { return server.count("coil 3 1") == 2; }))
        << "commanded every time";
    EXPECT_TRUE(coils.show(Tune::none, 4 * kSecond)) << "off it is as commanded";
}

TEST_F(CoilsOnTheWire, WhatRefusesIsReportedAndWhatIsMuteIsSoughtAgain) {
    const CoilServer refusing("refuses"), mute("mute");
    Coils refused(settings(refusing));
    EXPECT_FALSE(refused.show(Tune::stop, kSecond));
    EXPECT_NE(refused.note().find("cannot write the lamp: "), std::string::npos) << refused.note();
    auto short_of_patience = settings(mute);
    short_of_patience.wait_ms = 200;
    Coils waiting(short_of_patience);
    EXPECT_FALSE(waiting.show(Tune::stop, kSecond));
    EXPECT_NE(waiting.note().find("timed out"), std::string::npos) << waiting.note();
    EXPECT_FALSE(waiting.show(Tune::stop, 4 * kSecond));
}

TEST_F(CoilsOnTheWire, TheDaemonMaySoundTheSameHorn) {
    const CoilServer server("honest");
    drivers::HornSettings same;
    same.host = "127.0.0.1";
    same.port = server.port();
    same.horn_coil = 3;
    same.lamp_coil = 4;
    same.response_timeout = 5 * kSecond;
    drivers::Horn daemon(same);
    Coils guard(settings(server));
    using drivers::HornPattern;
    ASSERT_TRUE(daemon.show(HornPattern::disobeyed, kSecond));
    ASSERT_TRUE(guard.show(Tune::disobeyed, kSecond));
    // WHEN the daemon has done and goes on saying nothing
    ASSERT_TRUE(daemon.show(HornPattern::none, 2 * kSecond));
    // THEN the guard sounds it again, and is not silenced any more
    ASSERT_TRUE(guard.show(Tune::disobeyed, 2 * kSecond)) << guard.note();
    ASSERT_TRUE(daemon.show(HornPattern::none, 3 * kSecond));
    ASSERT_TRUE(guard.show(Tune::disobeyed, 3 * kSecond));
    EXPECT_TRUE(eventually([&] { return server.count("coil 3 1") == 2; }));
    EXPECT_EQ(server.count("coil 3 0"), 1U);
}

TEST_F(CoilsOnTheWire, OnlyATableThatObeysNoStopIsLeftSounding) {
    const CoilServer server("honest");
    {
        Alarm alarm(settings(server));
        alarm.show(Tune::stop);
        EXPECT_TRUE(eventually([&] { return server.count("coil 4 1") == 1; }));
        EXPECT_TRUE(alarm.confirms());
    }
    EXPECT_TRUE(eventually([&] { return server.count("coil 4 0") == 1; }));
    {
        Alarm alarm(settings(server));
        alarm.show(Tune::disobeyed);
        EXPECT_TRUE(eventually([&] { return server.count("coil 4 1") == 2; }));
    }
    EXPECT_EQ(server.count("coil 4 0"), 1U);
}

TEST_F(CoilsOnTheWire, ADeviceThatGoesAwayIsKnownBeforeItIsNeeded) {
    CoilServer server("honest");
    Alarm alarm(settings(server));
    alarm.show(Tune::stop);
    ASSERT_TRUE(eventually([&] { return server.count("coil 4 1") == 1; }));
    alarm.show(Tune::none);
    server.end();
    EXPECT_TRUE(eventually([&] { return !alarm.confirms(); }));
}

AlarmSettings with(const Script& script, Time limit = 600 * kSecond) {
    AlarmSettings settings;
    settings.command = script.path();
    settings.command_limit = limit;
    return settings;
}

TEST(Pager, GetsWhatHappenedAsJson) {
    const Script script("cat >paged.new && mv paged.new paged");
    Alarm alarm(with(script));
    alarm.page(Tune::disobeyed, "a \"quoted\"\nline\\ and bytes \xff");
    ASSERT_TRUE(eventually([&] { return !script.text_of("paged").empty(); }));
    const auto paged = nlohmann::json::parse(script.text_of("paged"));
    EXPECT_EQ(paged["source"], "vibrig-guard");
    EXPECT_EQ(paged["kind"], "disobeyed");
    EXPECT_EQ(paged["text"].get<std::string>().substr(0, 15), "a \"quoted\"\nline");
    EXPECT_EQ(paged["time"].get<std::string>().size(), 20U);
}

TEST(Pager, OneThatHangsWithAStopDoesNotHoldUpThatTheStopIsNotObeyed) {
    // GIVEN a command that hangs with its child when it gets a stop
    const Script script(
        "cat >text; if grep -q abort text; then sleep 1000 & echo $! >child; wait; else mv text "
        "paged; fi");
    const auto begun = std::chrono::steady_clock::now();
    {
        Alarm alarm(with(script));
        for (int i = 0; i < 100; ++i) alarm.page(Tune::stop, "stop " + std::to_string(i));
        ASSERT_TRUE(eventually([&] { return script.process_of("child") > 0; }));
        alarm.page(Tune::disobeyed, "not obeyed");
        EXPECT_TRUE(eventually([&] { return !script.text_of("paged").empty(); }));
    }
    // THEN nobody has waited for it, and its end took the child along
    EXPECT_LT(std::chrono::steady_clock::now() - begun, std::chrono::seconds(300));
    EXPECT_TRUE(eventually([&] { return dead(script.process_of("child")); }));
}

TEST(Pager, DoesNotWaitForAHornThatIsStillBeingLookedUp) {
    // GIVEN a horn whose name server is dead
    const Script script("cat >paged.new && mv paged.new paged");
    HostName horn("horn.test", {"127.0.0.1"}, HostName::Server::is_silent);
    auto settings = with(script);
    settings.host = "horn.test";
    settings.port = 9;
    Alarm alarm(settings);
    EXPECT_TRUE(eventually([&] { return horn.asked(); }));
    // WHEN something happens, THEN somebody is paged, though the server never answers
    alarm.page(Tune::stop, "stopped");
    EXPECT_TRUE(eventually([&] { return !script.text_of("paged").empty(); }));
    horn.answer();  // its end waits for the look-up
}

TEST(Pager, WhatHangsIsKilledWithItsChildrenWhenItsTimeIsUp) {
    const Script script("trap '' TERM INT HUP\nsleep 1000 & echo $! >child\nwait\nsleep 1000");
    Pager pager(script.path(), 2 * kSecond);
    ASSERT_EQ(pager.start("x", 0), "");
    ASSERT_TRUE(eventually([&] { return script.process_of("child") > 0; }));
    EXPECT_EQ(pager.attend(kSecond), "");
    std::string said;
    EXPECT_TRUE(eventually([&] { return !(said = pager.attend(3 * kSecond)).empty(); }));
    EXPECT_NE(said.find("killed after 2 s"), std::string::npos) << said;
    EXPECT_TRUE(eventually([&] { return dead(script.process_of("child")); }));
    EXPECT_FALSE(pager.busy());
}

TEST(Pager, FailuresAndFloodsAreNobodysTrouble) {
    const auto end_of = [](Pager& pager) {
        std::string said;
        EXPECT_TRUE(eventually([&] {
            said += pager.attend(0);
            return !pager.busy();
        }));
        return said;
    };
    const Script fails("exit 3"),
        floods("head -c 10000000 /dev/zero; head -c 10000000 /dev/zero >&2");
    Pager failing(fails.path(), kSecond), flooding(floods.path(), kSecond);
    ASSERT_EQ(failing.start("x", 0), "");
    EXPECT_NE(end_of(failing).find("ended with status 3"), std::string::npos);
    ASSERT_EQ(flooding.start("x", 0), "");
    EXPECT_EQ(end_of(flooding), "");
    Pager nowhere("/no/such/program", kSecond);
    EXPECT_NE(nowhere.start("x", 0).find("cannot be started: No such file"), std::string::npos);
    EXPECT_FALSE(nowhere.busy());
}

}  // namespace
}  // namespace vibrig::guard
