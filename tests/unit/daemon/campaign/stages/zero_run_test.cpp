#include <string>

#include "tests/unit/daemon/campaign/campaign_fixture.hpp"

namespace vibrig::campaign {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using State = CampaignState;

constexpr std::uint16_t kIdle = 0, kRunning = 2, kFault = 4;

/// A controller with a watchdog of its own, a chain and what is wrong with them; the table stands.
struct ZeroRunTest : CampaignTest {
    rt::StageFeed feed{dbc, {.block = 4, .velocity = {}}, nullptr};
    // its truth
    bool fires = true, fires_if_linked = true, fires_if_unlinked = true;
    bool stays = true;  ///< after its watchdog has fired
    bool fires_although_fed = false;
    bool starts_with_chain = false;  ///< once that is closed again
    bool chain_cuts = true, chain_shown = true;
    double measured_g = 0;
    std::uint16_t state = kIdle, idle_state = kIdle;
    bool open = false;
    double starved_s = 0;
    std::size_t taken = 0;

    ZeroRunTest() {
        settings.proof.buttons = {"rack", "door"};
        settings.sample_s = 0.025;
        rig_port.feed = &feed;
        accelerometers.also = [this](const drivers::Sample& sample) { feed.take(sample); };
        shaker_obeys = false;
        steady_clock = [this] { return now; };
        make();
        for (int i = 0; i < 20; ++i) live();
    }

    /// 100 ms of all of it.
    void live() {
        const bool linked = now + 100 * kMillisecond >= shaker.hung_up_until || shaker.stop_waits;
        const bool fed = proving != Proving::watchdog && proving != Proving::unlinked;
        starved_s = fed || state != kRunning ? 0 : starved_s + 0.1;
        const bool works = fires && (linked ? fires_if_linked : fires_if_unlinked);
        if (!works) starved_s = std::min(starved_s, 0.1);
        if (state == kRunning && (starved_s > 1.5 || fires_although_fed)) state = kFault;
        if (state == kFault && !stays && !open && starved_s == 0) state = kRunning;
        if (open && chain_cuts && state == kRunning) state = kFault;
        if (shaker.stop_waits.exchange(false)) {
            if (!open) state = idle_state;
            taken = shaker.requests.size();
        } else if (linked && taken < shaker.requests.size()) {
            taken = shaker.requests.size();
            state = shaker.requests.back().run_at_zero ? kRunning : idle_state;
        }
        shaker.now.valid = linked;
        if (linked) {
            shaker.now.state = state;
            shaker.now.fault = state == kFault ? 1 : 0;
            shaker.now.running = state == kRunning;
            shaker.now.measured_g = state == kRunning ? measured_g : 0;
            shaker.now.frequency_hz = 15;
            shaker.now.emergency_stop_open = open && chain_shown;
        }
        const Time before = shaker.now.time;
        accelerometers.table_g = accelerometers.table_g.value_or(0);
        // As the interlock does it.
        if (linked && status().state == State::checking) {
            if (shaker.now.emergency_stop_open)
                campaign->on_trip("emergency-stop chain open", now);
            else if (proving == Proving::nothing && shaker.now.fault != 0)
                campaign->on_trip("shaker fault", now);
        }
        run_rig();
        if (!linked) shaker.now.time = before;
    }

    void order(const std::string& what) {
        const auto reply = campaign->command({Kind::selftest, "Ada", what}, now);
        ASSERT_TRUE(reply.accepted) << reply.message;
    }
    /// Until the proof is over.
    const ProofRecord& over(double seconds = 120) {
        for (int i = 0; i < static_cast<int>(10 * seconds) && proofs.empty(); ++i) live();
        if (proofs.empty()) {
            ADD_FAILURE() << "not over";
            proofs.emplace_back();
        }
        return proofs.back();
    }
    double row(const std::string& name) const {
        for (const auto& one : proofs.back().rows)
            if (one.name == name) return one.value;
        return -1;
    }
    bool ever_asked_for_more() const {
        return std::ranges::any_of(shaker.requests, [](const drivers::ShakerSetPoint& one) {
            return one.amplitude_g > 0;
        });
    }
    /// At 0 g, the button is pressed when it is asked for, and released 2 s after it is seen.
    const ProofRecord& pressed(const std::string& button = "rack") {
        const auto before = proofs.size();
        open_for = 0;
        order("at_zero emergency_stop " + button);
        for (int i = 0; i < 600 && proofs.size() == before; ++i) {
            live();
            const auto asks = status().proof.asks;
            if (asks.starts_with("press")) open = true;
            if (open && (asks.starts_with("close") || !chain_shown) && ++open_for > 20) {
                open = false;
                if (starts_with_chain) state = kRunning;
            }
        }
        return over(1);
    }
    int open_for = 0;
};

TEST_F(ZeroRunTest, AnHonestControllerRunsStopsAndIsStoppedTwice) {
    order("at_zero");
    EXPECT_THAT(status().armed_for, HasSubstr("a run at 0 g"));
    const auto& record = over();
    EXPECT_TRUE(record.passed) << record.message;
    EXPECT_EQ(record.table_g, 0);
    // A watchdog of 1.5 s that is fed until now; the reading is of the next poll.
    EXPECT_NEAR(row("watchdog at 0 g, not fed"), 1.5, 0.3);
    EXPECT_LE(row("watchdog at 0 g, link closed"), 2.0);
    EXPECT_GE(row("watchdog at 0 g, link closed"), 1.5);
    EXPECT_EQ(row("watchdog at 0 g, stays stopped"), 1);
    EXPECT_NEAR(row("watchdog at 0 g, fed"), 7.5, 1e-9);
    EXPECT_LT(row("at 0 g, platform off 1 g"), 1e-6);
    EXPECT_FALSE(ever_asked_for_more());
    EXPECT_TRUE(campaign->proof().ran_at_zero());
    EXPECT_EQ(status().state, State::idle);
    // AND it is no proof of the safe state
    EXPECT_EQ(campaign->proof().transmission(), std::nullopt);
}

TEST_F(ZeroRunTest, AWatchdogThatDoesNotWorkIsFoundAtNothing) {
    fires = false;
    order("at_zero");
    EXPECT_THAT(over().message, HasSubstr("the watchdog was not fed, and did not stop"));
    EXPECT_FALSE(ever_asked_for_more());
    live();
    live();
    EXPECT_EQ(state, kIdle) << "it is stopped by order then";
}

TEST_F(ZeroRunTest, AWatchdogThatNeedsALinkIsFoundWithTheLinkClosed) {
    fires_if_unlinked = false;
    order("at_zero");
    EXPECT_THAT(over().message,
                HasSubstr("with its link closed the watchdog did not stop the controller"));
    EXPECT_NEAR(row("watchdog at 0 g, not fed"), 1.5, 0.3);
}

TEST_F(ZeroRunTest, AWatchdogThatFiresOnlyWithTheLinkClosedIsFoundWhileItIsRead) {
    fires_if_linked = false;
    order("at_zero");
    EXPECT_THAT(over().message, HasSubstr("the watchdog was not fed, and did not stop"));
}

TEST_F(ZeroRunTest, AWatchdogThatFiresAlthoughItIsFedEndsIt) {
    order("at_zero");
    // The first run of 5 s is over.
    for (int i = 0; i < 120; ++i) live();
    ASSERT_EQ(proving, Proving::nothing);
    fires_although_fed = true;
    EXPECT_THAT(over().message,
                AllOf(HasSubstr("shaker fault"), HasSubstr("while its watchdog was fed")));
}

TEST_F(ZeroRunTest, ATableThatMovesAlthoughNothingIsCommandedEndsIt) {
    accelerometers.table_g = 0;
    accelerometers.platform_g = 0;
    order("at_zero");
    while (shaker.requests.empty()) live();
    accelerometers.table_g = 0.015;
    EXPECT_THAT(over().message, HasSubstr("the table moves although 0 g is commanded"));
}

TEST_F(ZeroRunTest, APlatformThatFeelsItEndsIt) {
    accelerometers.platform_g = 0;
    order("at_zero");
    while (shaker.requests.empty()) live();
    accelerometers.platform_g = 0.006;
    EXPECT_THAT(over().message, HasSubstr("the platform feels"));
}

TEST_F(ZeroRunTest, AControllerThatIsNotIdleAfterItRanIsReported) {
    order("at_zero");
    while (shaker.requests.empty()) live();
    idle_state = 3;  // stopping, for ever
    EXPECT_THAT(over().message, HasSubstr("not idle after it ran"));
}

TEST_F(ZeroRunTest, AButtonStopsItIsSeenAndNothingStartsForTenSeconds) {
    const auto& record = pressed();
    EXPECT_TRUE(record.passed) << record.message;
    EXPECT_TRUE(record.emergency_stop);
    EXPECT_EQ(record.button, "rack");
    EXPECT_LE(row("emergency stop, seen"), 0.5);
    EXPECT_LE(row("emergency stop, controller"), 0.5);
    EXPECT_EQ(campaign->proof().buttons_left(), std::vector<std::string>{"door"});
    EXPECT_FALSE(campaign->proof().ran_at_zero()) << "that is the watchdog's";
    EXPECT_EQ(status().state, State::tripped);
}

TEST_F(ZeroRunTest, AButtonThatDoesNotStopIsFound) {
    chain_cuts = false;
    EXPECT_THAT(pressed().message, HasSubstr("emergency stop, the controller says fault 0"));
}

TEST_F(ZeroRunTest, AChainWhoseRegisterIsStuckIsFound) {
    chain_shown = false;
    EXPECT_THAT(pressed().message, HasSubstr("not completed: shaker fault"));
    EXPECT_EQ(campaign->proof().buttons_left().size(), 2U);
}

TEST_F(ZeroRunTest, AControllerThatStartsOnceTheButtonIsReleasedIsFoundAndStopped) {
    starts_with_chain = true;
    EXPECT_THAT(pressed().message, HasSubstr("closing the chain starts nothing 0"));
    for (int i = 0; i < 10; ++i) live();
    EXPECT_EQ(state, kIdle);
}

TEST_F(ZeroRunTest, NothingShakesBeforeItWasMade) {
    campaign->climb_next_proof(true);
    const auto reply = campaign->command({Kind::selftest, "Ada", ""}, now);
    EXPECT_FALSE(reply.accepted);
    EXPECT_THAT(reply.message, HasSubstr("has not run at 0 g yet"));
    EXPECT_FALSE(campaign->command({Kind::selftest, "Ada", "at_zero somewhat"}, now).accepted);
}

TEST_F(ZeroRunTest, NothingShakesBeforeEachButtonWasPressedAtZero) {
    const auto shaking = [this] {
        campaign->climb_next_proof(true);
        return campaign->command({Kind::selftest, "Ada", ""}, now);
    };
    order("at_zero");
    ASSERT_TRUE(over().passed);
    for (const char* left : {"(\"rack\", \"door\")", "(\"door\")"}) {
        const auto reply = shaking();
        EXPECT_FALSE(reply.accepted);
        EXPECT_THAT(reply.message, AllOf(HasSubstr("was not pressed at 0 g yet"), HasSubstr(left),
                                         HasSubstr("vibrig commission stop")));
        EXPECT_FALSE(ever_asked_for_more());
        const std::string button = std::string(left) == "(\"door\")" ? "door" : "rack";
        ASSERT_TRUE(pressed(button).passed) << proofs.back().message;
        ASSERT_TRUE(campaign->command({Kind::acknowledge, "Ada", "trip"}, now).accepted);
        for (int i = 0; i < 20; ++i) live();
    }
    EXPECT_TRUE(shaking().accepted);
    // AND of a shaker that is understood no button is asked for
    campaign->command({Kind::abort, "Ada", ""}, now);
}

}  // namespace
}  // namespace vibrig::campaign
