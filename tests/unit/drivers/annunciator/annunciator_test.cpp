#include "drivers/annunciator/annunciator.hpp"

#include <gtest/gtest.h>

#include <chrono>

#include "coil_server.hpp"
#include "scripts.hpp"
#include "tests/unit/support/host_names.hpp"

namespace vibrig::drivers::test {
namespace {

using std::chrono::steady_clock;

AnnunciatorSettings with_command(const Script& script) {
    AnnunciatorSettings settings;
    settings.command = script.path();
    settings.command_limit = 30 * kSecond;
    return settings;
}

/// What it said, in order.
class Said {
  public:
    Annunciator::Say taker() {
        return [this](bool good, const std::string& text) {
            const std::lock_guard lock(mutex_);
            lines_.push_back((good ? "good: " : "bad: ") + text);
        };
    }
    [[nodiscard]] bool has(const std::string& part) const {
        const std::lock_guard lock(mutex_);
        for (const auto& line : lines_)
            if (line.find(part) != std::string::npos) return true;
        return false;
    }

  private:
    mutable std::mutex mutex_;
    std::vector<std::string> lines_;
};

TEST(Annunciator, TheCommandGetsWhatHappenedAsJson) {
    const Script script("cat >paged.new && mv paged.new paged");
    Annunciator annunciator(with_command(script), {});
    annunciator.announce(HornPattern::abort, "a \"quoted\"\nline\\ with \xce\xa9");
    ASSERT_TRUE(eventually([&] { return !script.text_of("paged").empty(); }));
    const auto paged = script.text_of("paged");
    EXPECT_NE(paged.find(R"({"source":"vibrigd","kind":"abort","time":"2)"), std::string::npos)
        << paged;
    EXPECT_NE(paged.find("\"text\":\"a \\\"quoted\\\"\\nline\\\\ with \xce\xa9\"}\n"),
              std::string::npos)
        << paged;
}

TEST(Annunciator, NobodyWaitsForACommandThatHangsAndWhatPilesUpIsBounded) {
    // GIVEN a command that hangs, longer than anybody would wait here
    const Script script("exec sleep 1000");
    auto settings = with_command(script);
    settings.command_limit = 600 * kSecond;
    const auto begun = steady_clock::now();
    {
        Annunciator annunciator(settings, {});
        // WHEN alarms come in a storm
        for (int i = 0; i < 1000; ++i)
            annunciator.announce(HornPattern::alarm, "alarm " + std::to_string(i));
        // THEN four are paged, sixteen wait, and the rest is counted
        EXPECT_TRUE(eventually([&] { return annunciator.status().started == 4; }));
        EXPECT_TRUE(eventually([&] { return annunciator.status().left_out >= 1000 - 16 - 4; }));
        EXPECT_LE(annunciator.status().left_out, 1000u - 16u);
    }
    EXPECT_LT(steady_clock::now() - begun, std::chrono::seconds(300)) << "its end waits for none";
}

TEST(Annunciator, APageDoesNotWaitForAHornThatIsStillBeingLookedUp) {
    // GIVEN a horn whose name server is dead
    const Script script("cat >paged.new && mv paged.new paged");
    HostName horn("horn.test", {"127.0.0.1"}, HostName::Server::is_silent);
    auto settings = with_command(script);
    settings.horn.host = "horn.test";
    settings.horn.port = 9;
    Annunciator annunciator(settings, {});
    EXPECT_TRUE(eventually([&] { return horn.asked(); }));
    // WHEN something happens, THEN somebody is paged, though the server never answers
    annunciator.announce(HornPattern::abort, "tripped");
    EXPECT_TRUE(eventually([&] { return !script.text_of("paged").empty(); }));
    EXPECT_TRUE(eventually([&] { return annunciator.status().started == 1; }));
    horn.answer();  // its end waits for the look-up
}

TEST(Annunciator, AFailureOfTheCommandIsSaidAndCounted) {
    const Script script("exit 3");
    Said said;
    Annunciator annunciator(with_command(script), said.taker());
    annunciator.announce(HornPattern::alarm, "x");
    EXPECT_TRUE(eventually([&] { return annunciator.status().failed == 1; }));
    EXPECT_TRUE(eventually([&] { return said.has("bad: ") && said.has("status 3"); }));
    EXPECT_NE(annunciator.status().command_note.find("status 3"), std::string::npos);
}

TEST(Annunciator, ACommandThatCannotBeRunIsReportedBeforeItIsNeeded) {
    const Script script("exit 0", false);
    Said said;
    Annunciator annunciator(with_command(script), said.taker());
    EXPECT_TRUE(eventually([&] { return said.has("bad: ") && said.has("Permission denied"); }));
    EXPECT_NE(annunciator.status().command_note.find("cannot be run"), std::string::npos);
    ASSERT_EQ(::chmod(script.path().c_str(), 0700), 0);
    EXPECT_TRUE(eventually([&] { return said.has("good: the command can be run again"); }));
    EXPECT_EQ(annunciator.status().command_note, "");
    EXPECT_EQ(annunciator.status().failed, 0u) << "and it was never run for that";
}

TEST(Annunciator, OfACommandThatWorksAgainNothingIsHeldAgainstIt) {
    const Script script("[ -e well ]");
    Annunciator annunciator(with_command(script), {});
    annunciator.announce(HornPattern::alarm, "x");
    EXPECT_TRUE(eventually([&] { return !annunciator.status().command_note.empty(); }));
    script.make("well");
    annunciator.announce(HornPattern::alarm, "x");
    EXPECT_TRUE(eventually([&] { return annunciator.status().command_note.empty(); }));
    EXPECT_EQ(annunciator.status().failed, 1u);
}

class AnnunciatorOnTheWire : public testing::Test {
  protected:
    void SetUp() override {
        if (!have_pymodbus()) GTEST_SKIP() << "python3-pymodbus is not installed";
    }
    static AnnunciatorSettings with_horn(const CoilServer& server) {
        AnnunciatorSettings settings;
        settings.horn.host = "127.0.0.1";
        settings.horn.port = server.port();
        settings.horn.lamp_coil = 1;
        settings.horn.response_timeout = 5 * kSecond;
        return settings;
    }
};

TEST_F(AnnunciatorOnTheWire, SoundsAtOnceAndIsSilentAgainAtItsEnd) {
    CoilServer server("honest");
    {
        Annunciator annunciator(with_horn(server), {});
        annunciator.show(HornPattern::abort);
        EXPECT_TRUE(eventually([&] { return server.count("coil 0 1") >= 1; }));
        EXPECT_TRUE(annunciator.status().confirms);
    }
    EXPECT_TRUE(eventually([&] { return server.count("coil 1 0") == 1; }));
}

TEST_F(AnnunciatorOnTheWire, ATableThatObeysNoStopIsLeftSounding) {
    CoilServer server("honest");
    {
        Annunciator annunciator(with_horn(server), {});
        annunciator.show(HornPattern::disobeyed);
        EXPECT_TRUE(eventually([&] { return server.count("coil 1 1") == 1; }));
    }
    EXPECT_EQ(server.count("coil 0 0") + server.count("coil 1 0"), 0u);
}

TEST_F(AnnunciatorOnTheWire, AHornThatLiesIsItselfAnAlarm) {
    CoilServer server("deaf");
    Said said;
    Annunciator annunciator(with_horn(server), said.taker());
    annunciator.show(HornPattern::disobeyed);
    EXPECT_TRUE(eventually([&] { return !annunciator.status().confirms; }));
    EXPECT_TRUE(eventually([&] { return said.has("bad: horn or lamp do not confirm"); }));
    EXPECT_NE(annunciator.status().horn_note.find("reads back off"), std::string::npos);
}

TEST_F(AnnunciatorOnTheWire, OfAPatternNothingIsConfirmedBeforeItReadsBack) {
    CoilServer server("mute");
    auto settings = with_horn(server);
    settings.horn.response_timeout = kSecond / 2;
    Annunciator annunciator(settings, {});
    annunciator.show(HornPattern::abort);
    bool believed = false;
    EXPECT_TRUE(eventually([&] {
        const auto status = annunciator.status();
        believed = believed || (status.pattern == HornPattern::abort && status.confirms);
        return !status.confirms;
    }));
    EXPECT_FALSE(believed);
    EXPECT_EQ(annunciator.status().pattern, HornPattern::abort);
}

TEST_F(AnnunciatorOnTheWire, ADeviceThatGoesAwayIsReportedBeforeItIsNeeded) {
    CoilServer server("honest");
    Said said;
    Annunciator annunciator(with_horn(server), said.taker());
    annunciator.show(HornPattern::alarm);
    ASSERT_TRUE(eventually([&] { return server.count("coil 1 1") == 1; }));
    annunciator.show(HornPattern::none);
    server.end();
    EXPECT_TRUE(eventually([&] { return !annunciator.status().confirms; }));
    EXPECT_TRUE(eventually([&] { return said.has("bad: horn or lamp do not confirm"); }));
}

}  // namespace
}  // namespace vibrig::drivers::test
