// The opening check alone: no campaign, nothing is armed, the table never moves.
#include <functional>
#include <string>

#include "tests/unit/daemon/campaign/opening_fixture.hpp"

namespace vibrig::campaign {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using State = CampaignState;

struct RestCheckTest : OpeningTest {
    void ready_with(const std::function<void(estimator::Settings&)>& change) {
        open_with(change);
        run_for(1);
    }
    CommandReply order() {
        return campaign->command({Kind::selftest, "Ada", std::string(kRestCheck)}, now);
    }
    void run() {
        const auto reply = order();
        ASSERT_TRUE(reply.accepted) << reply.message;
        for (int n = 0; n < 6000; ++n) {
            run_rig();
            if (status().state != State::checking) return;
        }
        FAIL() << status().reason;
    }
    bool released() const { return (port.frames.back().data[6] & 0x0f) == 0; }
};

TEST_F(RestCheckTest, OfARightConfigurationSaysSoAndLeavesEverythingAsItWas) {
    ready_with([](estimator::Settings&) {});
    const auto before = shaker.requests.size();
    EXPECT_TRUE(order().accepted);
    run_for(60);
    EXPECT_EQ(status().state, State::checking);
    EXPECT_THAT(status().reason, HasSubstr("opening check, position 2 of 5"));
    EXPECT_STREQ(status().rest_check.verdict, "running");
    EXPECT_EQ(status().armed_by, "");
    EXPECT_TRUE(run_until(State::idle, 600));
    const auto check = status().rest_check;
    EXPECT_STREQ(check.verdict, "right") << check.message;
    EXPECT_EQ(check.by, "Ada");
    EXPECT_THAT(check.suspects, IsEmpty());
    EXPECT_THAT(events, Contains("opening check: the rig is what its configuration says"));
    EXPECT_EQ(shaker.requests.size(), before) << "the shaker is asked for nothing";
    EXPECT_TRUE(released());
    EXPECT_EQ(status().reason, "");
    // It is no loop check and no campaign, and no proof of the safe state.
    EXPECT_THAT(status().loop_check.rows, IsEmpty());
    EXPECT_THAT(proofs, IsEmpty());
    EXPECT_EQ(ends, 0);
    const auto frames = port.frames.size();
    run_for(60);
    for (auto i = frames; i < port.frames.size(); ++i)
        EXPECT_NE(port.frames[i].data[6] & 0x0f, 1) << "nothing slews afterwards";
}

TEST_F(RestCheckTest, NamesTheKeyThatWouldExplainIt) {
    ready_with([](auto& s) { s.encoder_sign[1] = -1; });
    run();
    const auto check = status().rest_check;
    EXPECT_EQ(status().state, State::idle);
    EXPECT_STREQ(check.verdict, "refused");
    EXPECT_THAT(check.message, HasSubstr("vertical by the encoders"));
    EXPECT_THAT(check.suspects,
                Contains(HasSubstr("platform.encoder_sign: 1 instead of -1 of the inner")));
    EXPECT_LE(check.suspects.size(), 3U);
    EXPECT_TRUE(released());
    // The next arming does not mention it: each campaign looks for itself.
    EXPECT_TRUE(command(Kind::arm).accepted);
}

TEST_F(RestCheckTest, TellsWhatIsTooLittleToRefuse) {
    ready_with([](auto& s) {
        s.azimuth_deg = 1.2;  // N and E off by 10.5 sin 1.2 deg = 0.22 deg/h: warned above 0.1
    });
    run();
    const auto check = status().rest_check;
    EXPECT_STREQ(check.verdict, "told");
    EXPECT_THAT(check.message, HasSubstr("warned above 0.10, refused above 0.50"));
    EXPECT_THAT(check.suspects, Contains(HasSubstr("site.azimuth_deg: ")));
}

TEST_F(RestCheckTest, IsRefusedWhereverGimbalsMayNotMove) {
    ready_with([](estimator::Settings&) {});
    EXPECT_TRUE(command(Kind::arm).accepted);
    EXPECT_THAT(order().message, HasSubstr("armed for a campaign: abort that first"));
    EXPECT_TRUE(command(Kind::start).accepted);
    run_for(5);
    EXPECT_THAT(order().message, HasSubstr("a campaign is running"));
    EXPECT_TRUE(command(Kind::abort).accepted);
    run_for(5);
    ASSERT_EQ(campaign->begin_commissioning("Bo", now), "");
    EXPECT_THAT(order().message, HasSubstr("the rig is being commissioned by Bo"));
    campaign->end_commissioning(now);
    shaker.now.emergency_stop_open = true;
    EXPECT_THAT(order().message, HasSubstr("the emergency-stop chain is open"));
    shaker.now.emergency_stop_open = false;
    shaker.now.running = true;
    shaker.now.state = 2;
    EXPECT_THAT(order().message, HasSubstr("the shaker is not at rest"));
    shaker.now.running = false;
    shaker.now.state = 0;
    platform.loop_closed = false;
    EXPECT_THAT(order().message, HasSubstr("stabilisation loop open"));
    platform.loop_closed = true;
    ASSERT_TRUE(order().accepted);
    EXPECT_THAT(order().message, HasSubstr("an opening check is running"));
    EXPECT_THAT(command(Kind::arm).message, HasSubstr("an opening check is running"));
    EXPECT_THAT(command(Kind::start).message, HasSubstr("an opening check is running"));
    campaign->on_trip("a sensor is silent", now);
    EXPECT_THAT(order().message, HasSubstr("tripped (a sensor is silent): acknowledge it first"));
    EXPECT_STREQ(status().rest_check.verdict, "not completed");
    EXPECT_THAT(status().rest_check.message, HasSubstr("a sensor is silent"));
    run_for(1);
    EXPECT_TRUE(released());
}

TEST_F(RestCheckTest, AsksNothingOfAControllerThatIsOnlyRead) {
    ready_with([](estimator::Settings&) {});
    campaign->hold_writes();  // its registers are not tried yet
    using Timeout = drivers::WatchdogTimeout;
    for (const auto timeout : {Timeout::unread, Timeout::changed}) {
        shaker.now.watchdog = timeout;
        EXPECT_TRUE(order().accepted);
        EXPECT_TRUE(command(Kind::abort).accepted);
        run_for(5);
        for (const auto kind : {Kind::arm, Kind::selftest})
            EXPECT_THAT(command(kind).message, HasSubstr("its registers had not been tried"));
    }
}

TEST_F(RestCheckTest, WithoutPositionsThereIsNone) {
    settings.opening.clear();
    make();
    EXPECT_THAT(order().message, HasSubstr("opening check: no position is within"));
}

TEST_F(RestCheckTest, AnAbortAShakerThatMovesAndAShutdownEndIt) {
    ready_with([](estimator::Settings&) {});
    ASSERT_TRUE(order().accepted);
    run_for(60);
    EXPECT_TRUE(command(Kind::abort).accepted);
    run_for(1);
    EXPECT_EQ(status().state, State::aborted);
    EXPECT_STREQ(status().rest_check.verdict, "not completed");
    EXPECT_THAT(status().rest_check.message, HasSubstr("aborted by Ada"));
    EXPECT_THAT(events, Contains("opening check aborted: aborted by Ada"));
    EXPECT_TRUE(released());
    EXPECT_EQ(ends, 0);
    ASSERT_TRUE(order().accepted) << "and it begins anew";
    run_for(20);
    shaker_obeys = false;
    shaker.now.state = 2;
    shaker.now.running = true;
    run_for(1);
    EXPECT_NE(status().state, State::checking);
    EXPECT_TRUE(released());
    shaker.now.state = 0;
    shaker.now.running = false;
    shaker_obeys = true;
    run_for(5);
    make();
    run_for(5);
    ASSERT_TRUE(order().accepted);
    run_for(20);
    campaign->shut_down(now);
    run_for(2);
    EXPECT_TRUE(campaign->done(now));
    EXPECT_TRUE(released());
}

/// Whether a campaign makes it by itself is another question.
TEST_F(RestCheckTest, OfACampaignThatDoesNotOpenWithItIsMadeOnOrderOnly) {
    settings.open_first = false;
    ready_with([](estimator::Settings&) {});
    EXPECT_TRUE(command(Kind::arm).accepted);
    EXPECT_TRUE(command(Kind::start).accepted);
    EXPECT_TRUE(run_until(State::ramping, 60)) << status().reason;
    EXPECT_THAT(events, Not(Contains(HasSubstr("opening check"))));
    EXPECT_TRUE(command(Kind::abort).accepted);
    run_for(30);
    run();
    EXPECT_STREQ(status().rest_check.verdict, "right");
}

}  // namespace
}  // namespace vibrig::campaign
