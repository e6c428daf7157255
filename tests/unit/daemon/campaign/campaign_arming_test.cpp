#include "tests/unit/daemon/campaign/campaign_fixture.hpp"

namespace vibrig::campaign {
namespace {

using testing::HasSubstr;

/// At rest, ready to be armed; people's time is the test's.
struct ArmingTest : CampaignTest {
    Time wall = 77 * kSecond;

    ArmingTest() {
        settings.name = "night";
        settings.table_g = {7, 9};
        settings.dwell_s = 100;
        settings.stop = {};
        remake();
    }
    void remake() {
        this->steady_clock = [this] { return wall; };
        make();
        run_for(3);
    }
    CommandReply order(Kind kind, const char* by = "Ada") {
        return campaign->command({kind, by, ""}, now);
    }
    void pass(double seconds) {
        wall += drivers::from_seconds(seconds);
        run_for(0.2);
    }
};

TEST_F(ArmingTest, NamesUnitPlanHighestLevelAndDuration) {
    settings.unit = "IMU-7 0042";
    remake();
    const auto reply = order(Kind::arm);
    ASSERT_TRUE(reply.accepted) << reply.message;
    // 4 positions of 100 s, 3 s of settling and 2 ramps of 2 s each
    const char* const expected =
        "IMU-7 0042, plan \"night\" (4 positions), up to 9 g at the table at 15 Hz, platform on "
        "isolators, about 8 min; to be started within 10 min";
    EXPECT_EQ(reply.message, std::string("armed for ") + expected);
    EXPECT_EQ(status().armed_for, expected);
    EXPECT_EQ(status().arming_left_s, 600);
    ASSERT_FALSE(events.empty());
    EXPECT_EQ(events.back(), std::string("armed for ") + expected + " by Ada");
}

TEST_F(ArmingTest, NamesEachFrequencyOnceAndTheHardMount) {
    settings.hard_mount = true;
    settings.stops.assign(4, {});
    for (std::size_t i = 0; i < 4; ++i) settings.stops[i].table_g = i == 3 ? 0 : 3;
    settings.stops[0].frequency_hz = 85.1;
    settings.stops[2].frequency_hz = 85.1;
    settings.stops[3].frequency_hz = 55;
    remake();
    EXPECT_THAT(order(Kind::arm).message,
                HasSubstr("up to 3 g at the table at 15, 85.1 Hz, platform bolted hard to it,"));
}

TEST_F(ArmingTest, SaysWhatOneSeesWhoKnowsTheReferenceTransmissionAlone) {
    settings.rig.transmission = 0.5;
    const auto seen = [this](const Stop& stop) {
        settings.stops = {{{}, 1.5}, stop};
        remake();
        return campaign->platform_ratio();
    };
    EXPECT_DOUBLE_EQ(seen({{}, 2}), 1);
    EXPECT_DOUBLE_EQ(seen({{}, 2, 60, false, 0.1}), 1) << "less of it shows, the table tells";
    EXPECT_DOUBLE_EQ(seen({{}, 1, 8, false, 1.25}), 2.5);
    EXPECT_DOUBLE_EQ(campaign->highest_level(), 1.5);
    Stop sweep{{}, 1};
    sweep.sweep = {8, 60, 100};
    sweep.along = {1.5, 1, 0.2};
    EXPECT_DOUBLE_EQ(seen(sweep), 3);
    Stop random{{}, 1.19, 0, false, 0.5};
    random.random.emplace();
    random.random->set_point.profile = 1;
    EXPECT_DOUBLE_EQ(seen(random), 1);
    EXPECT_DOUBLE_EQ(campaign->highest_level(), 3 * 1.19) << "peaks, as the arming says";
    EXPECT_THAT(order(Kind::arm).message, HasSubstr("up to 3.57 g"));
}

TEST_F(ArmingTest, SaysThatNoUnitIsStated) {
    EXPECT_THAT(order(Kind::arm).message, HasSubstr("armed for a unit that is not stated, plan"));
}

TEST_F(ArmingTest, EndsAfterItsTimeWithoutAStart) {
    settings.arming_valid_s = 30;
    remake();
    ASSERT_TRUE(order(Kind::arm).accepted);
    pass(29.9);
    EXPECT_EQ(status().state, CampaignState::armed);
    EXPECT_NEAR(status().arming_left_s, 0.1, 1e-9);
    pass(0.1);
    EXPECT_EQ(status().state, CampaignState::idle);
    EXPECT_EQ(campaign->armed_by(), "");
    EXPECT_EQ(status().armed_for, "");
    EXPECT_EQ(events.back(), "the arming by Ada has expired: not started within 30 s");
    EXPECT_FALSE(order(Kind::start).accepted);
    // and can be had again
    EXPECT_TRUE(order(Kind::arm).accepted);
}

TEST_F(ArmingTest, OfARunningCampaignDoesNotExpire) {
    settings.arming_valid_s = 30;
    remake();
    ASSERT_TRUE(order(Kind::arm).accepted);
    ASSERT_TRUE(order(Kind::start).accepted);
    pass(3600);
    EXPECT_EQ(campaign->armed_by(), "Ada");
    EXPECT_EQ(status().arming_left_s, 0);
}

/// A campaign that is paused at rest, armed by Ada.
struct PausedTest : ArmingTest {
    void begin() {
        ASSERT_TRUE(order(Kind::arm).accepted);
        ASSERT_TRUE(order(Kind::start).accepted);
        ASSERT_TRUE(run_until(CampaignState::recording, 60));
        ASSERT_TRUE(order(Kind::pause).accepted);
        ASSERT_TRUE(run_until(CampaignState::paused, 200));
    }
};

TEST_F(PausedTest, AResumeSaysWhoArmedAndWhen) {
    begin();
    pass(599);
    EXPECT_EQ(order(Kind::resume, "Grace").message, "resumed, armed by Ada 10 min ago");
    EXPECT_EQ(events.back(), "resumed by Grace, armed by Ada 10 min ago");
    // AND a pause that was never entered is taken back as it was
    ASSERT_TRUE(run_until(CampaignState::recording, 60));
    ASSERT_TRUE(order(Kind::pause).accepted);
    pass(3600);
    EXPECT_TRUE(order(Kind::resume).accepted);
    EXPECT_TRUE(run_until(CampaignState::finished, 1000)) << status().reason;
}

TEST_F(PausedTest, ALongPauseEndsTheArmingAndTheCampaignKeepsItsPlace) {
    begin();
    EXPECT_EQ(order(Kind::arm, "Grace").message, "a campaign is running") << "it is armed";
    pass(601);
    // THEN nobody is armed, and whoever resumes has to be
    EXPECT_EQ(events.back(), "the arming by Ada has expired: not resumed within 10 min");
    EXPECT_EQ(campaign->armed_by(), "");
    const auto refused = order(Kind::resume, "Bob");
    EXPECT_FALSE(refused.accepted);
    EXPECT_EQ(refused.message,
              "paused for more than 10 min, which has ended the arming: a named person arms it "
              "first");
    run_for(5);
    EXPECT_EQ(status().state, CampaignState::paused);
    // WHEN it is armed THEN for what is left, and where it was
    const auto armed = order(Kind::arm, "Bob");
    EXPECT_TRUE(armed.accepted) << armed.message;
    EXPECT_THAT(armed.message,
                testing::AllOf(HasSubstr("about 6 min"), HasSubstr("to be resumed within 10 min")));
    EXPECT_EQ(status().state, CampaignState::paused);
    pass(599);
    EXPECT_TRUE(order(Kind::resume, "Bob").accepted);
    EXPECT_TRUE(run_until(CampaignState::finished, 1000)) << status().reason;
    EXPECT_EQ(orders.size(), 4U);
    EXPECT_EQ(ends, 1);
}

TEST_F(PausedTest, AnArmingInAPauseExpiresAgain) {
    begin();
    pass(601);
    ASSERT_TRUE(order(Kind::arm, "Bob").accepted);
    pass(601);
    EXPECT_EQ(events.back(), "the arming by Bob has expired: not resumed within 10 min");
    EXPECT_FALSE(order(Kind::resume, "Bob").accepted);
    EXPECT_EQ(status().state, CampaignState::paused);
}

TEST_F(PausedTest, AResumeIsRefusedWhereAStartWouldBe) {
    begin();
    shaker.now.fault = 1;
    EXPECT_EQ(order(Kind::resume).message, "shaker fault 0x0001");
    shaker.now.fault = 0;
    accelerometers.table_g = 0.05;
    run_for(1);
    EXPECT_THAT(order(Kind::resume).message, testing::StartsWith("not at rest: table 0.03"));
    accelerometers.table_g.reset();
    run_for(1);
    EXPECT_EQ(status().state, CampaignState::paused);
    EXPECT_TRUE(order(Kind::resume).accepted);
}

TEST_F(PausedTest, AResumeIsRefusedWhereTheProofHasExpired) {
    settings.proof = {};
    settings.proof.keys = "a key";
    remake();
    SafetyProof proof(settings.proof);
    proof.begin("Ada", 0.5);
    proof.row("stop, table", "s", 1, 0, 3);
    campaign->take_over_proofs({proof.conclude(0, "")});
    begin();
    utc_ns = 169 * 3600 * kSecond;
    EXPECT_THAT(order(Kind::resume).message, HasSubstr("169.0 h old, valid for 168 h"));
    utc_ns = 167 * 3600 * kSecond;
    EXPECT_TRUE(order(Kind::resume).accepted);
}

TEST_F(ArmingTest, IsNamedWhenAnotherPersonStarts) {
    ASSERT_TRUE(order(Kind::arm).accepted);
    EXPECT_EQ(order(Kind::start, "Grace").message, "campaign started, armed by Ada");
    EXPECT_EQ(status().started_by, "Grace");
    // AND a second start is refused with what is going on
    const auto again = order(Kind::start, "Ada");
    EXPECT_FALSE(again.accepted);
    EXPECT_EQ(again.message, "a campaign is running, started by Grace");
}

TEST_F(ArmingTest, OfAnEarlierLifesTripSilenceIsNoRest) {
    // GIVEN a trip that an earlier life left, and a rig of which nobody hears anything
    campaign->take_over_trip("the daemon ended while armed by Ada", true);
    shaker.stop_now();
    shaker.now.valid = false;
    const auto pass_silently = [this](double seconds) {
        for (const Time end = now + drivers::from_seconds(seconds); now < end;) {
            now += 100 * kMillisecond;
            campaign->step(now);
        }
    };
    pass_silently(1);
    EXPECT_FALSE(disobeyed);
    EXPECT_FALSE(campaign->done(now));
    pass_silently(30);
    // THEN that is a stop which was not obeyed, and whoever ends it leaves it undone
    EXPECT_TRUE(disobeyed);
    campaign->shut_down(now);
    pass_silently(30);
    EXPECT_FALSE(campaign->done(now));
}

/// Of a plan the levels are the plan's, and table_g is not played.
TEST_F(ArmingTest, OfAnEarlierLifesTripThePadsRingDownFromThePlansLevel) {
    PadRingDown& pads = settings.stop.pads;
    pads = {0.5, 4, 0.5};
    settings.table_g = {9};
    settings.stops.resize(1);
    settings.stops[0].table_g = 3;
    make();
    // GIVEN a table that stands, and a platform that does not come to rest on its pads
    accelerometers.table_g = 0;
    accelerometers.platform_g = 1;
    campaign->take_over_trip("the daemon ended while armed by Ada", true);
    shaker.stop_now();
    const Time begun = now;
    while (!disobeyed && now < begun + 60 * kSecond) run_rig();
    // THEN it has the time that it has from 3 g
    EXPECT_GT(pads.from_s(9), pads.from_s(3) + 2) << "or this shows nothing";
    EXPECT_NEAR(drivers::to_seconds(now - begun), settings.stop.deadline_s + pads.from_s(3), 0.3);
}

TEST_F(ArmingTest, IsRefusedWhileAnEarlierLifesLatchIsNotAcknowledged) {
    campaign->take_over_trip("the daemon ended while armed by Ada");
    EXPECT_EQ(status().state, CampaignState::tripped);
    pass(10);
    const auto refused = order(Kind::arm);
    EXPECT_FALSE(refused.accepted);
    EXPECT_THAT(refused.message, HasSubstr("ended while armed by Ada"));
    EXPECT_EQ(campaign->refusal({Kind::arm, "Grace", ""}, now), refused.message);
    EXPECT_TRUE(shaker.requests.empty());
    EXPECT_TRUE(order(Kind::acknowledge, "Grace").accepted);
    EXPECT_EQ(campaign->refusal({Kind::arm, "Grace", ""}, now), "");
    EXPECT_TRUE(order(Kind::arm).accepted);
}

}  // namespace
}  // namespace vibrig::campaign
