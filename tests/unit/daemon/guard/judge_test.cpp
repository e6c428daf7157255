#include "daemon/guard/judge.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace vibrig::guard {
namespace {

using proto::GuardCause;

constexpr std::uint64_t kFirst = 1000;
constexpr double kLook_s = 0.05;

/// A rig as the guard sees it, and time that goes by. The daemon talks and goes on, unless set
/// otherwise.
class World {
  public:
    explicit World(double rig_speed = 1) : rig_speed_(rig_speed) {
        e.sight.has_table = e.sight.has_platform = true;
        e.now = e.rig = 100 * drivers::kSecond;
        e.word.emplace();
        shake(0);
    }
    /// The table does so much, peak.
    void shake(double table_g) {
        e.sight.table = {true, 0.001 + table_g / 1.5, 0.001 + table_g};
        e.sight.platform = {true, 0.001 + table_g / 2.5, 0.001 + table_g * 0.6667};
        e.sight.table_g = e.sight.by_platform_g = table_g;
    }
    void blind() { e.sight.table.known = e.sight.platform.known = false; }
    /// Goes on for so long; when a cause first appeared in it, s; -1: it did not.
    double pass(double seconds) {
        double found = -1;
        for (double t = kLook_s; t <= seconds + 1e-9; t += kLook_s) {
            const auto step = drivers::from_seconds(kLook_s);
            e.now += step;
            if (rig_goes)
                e.rig += static_cast<drivers::Time>(rig_speed_ * static_cast<double>(step));
            if (talks) {
                e.heard = e.now;
                ++e.word->sequence;
            }
            for (std::size_t i = 0; i < 4; ++i)
                if (talks && i != hangs) ++e.word->progress[i];
            judge.judge(e);
            if (found < 0 && judge.cause() != GuardCause::none) found = t;
        }
        return found;
    }
    void arm(double level_g, bool excitation = true) {
        e.word->armed = true;
        e.word->excitation = excitation;
        e.word->level_g = level_g;
    }
    void disarm() {
        e.word->armed = e.word->excitation = false;
        e.word->level_g = 0;
    }

    Evidence e;
    Judge judge{JudgeSettings{.most_ratio = 4}, kFirst};
    bool talks = true, rig_goes = true;
    std::size_t hangs = 99;

  private:
    double rig_speed_;
};

TEST(Judge, FindsNothingInAWholeCampaign) {
    World world;
    EXPECT_EQ(world.pass(10), -1);
    world.arm(9, false);
    EXPECT_EQ(world.pass(10), -1);
    for (double g = 0; g < 9; g += 0.2) {  // ramp, dwell at the level, ramp down, ring-down
        world.arm(9);
        world.shake(g);
        EXPECT_EQ(world.pass(0.1), -1) << g;
    }
    world.e.shaker = {true, true, 9};
    EXPECT_EQ(world.pass(60), -1);
    for (double g = 9; g > 0; g -= 0.2) {
        world.shake(g);
        EXPECT_EQ(world.pass(0.1), -1) << g;
    }
    world.e.shaker = {true, false, 0};
    world.disarm();
    world.shake(0.2);  // the pads ring on
    EXPECT_EQ(world.pass(2), -1);
    world.shake(0);
    EXPECT_EQ(world.pass(30), -1);
    EXPECT_EQ(world.judge.tune(), Tune::none);
    EXPECT_FALSE(world.judge.stop_wanted());
}

TEST(Judge, ADaemonThatFallsSilentWhileTheTableMovesIsFoundWithinItsDeadline) {
    World world;
    world.arm(9);
    world.shake(9);
    ASSERT_EQ(world.pass(5), -1);
    world.talks = false;
    EXPECT_NEAR(world.pass(2), safety::kHeartbeatDeadline_s, 2 * kLook_s);
    EXPECT_EQ(world.judge.cause(), GuardCause::daemon_silent);
    EXPECT_TRUE(world.judge.stop_wanted());
    EXPECT_EQ(world.judge.tune(), Tune::stop);
}

TEST(Judge, ThePlatformMayShowMoreOfAPlansOtherVibrationTheTableMayNot) {
    World world;
    world.arm(9);
    world.e.word->platform_ratio = 2;
    world.shake(9);
    world.e.sight.by_platform_g = 17;  // it lets through twice what it does at the reference
    EXPECT_EQ(world.pass(5), -1);
    world.e.sight.by_platform_g = 9 * 2 * 1.2;  // 1 dB are 12 %
    EXPECT_GE(world.pass(5), 0);
    EXPECT_EQ(world.judge.cause(), GuardCause::over_level);
    World table;
    table.arm(9);
    table.e.word->platform_ratio = 2;
    table.shake(9 * 1.2);
    table.e.sight.by_platform_g = 9;
    EXPECT_GE(table.pass(5), 0) << "by the table itself";
}

TEST(Judge, ARatioBeyondWhatTheMountLetsThroughIsNotBelieved) {
    World world;
    world.arm(3);
    world.e.word->platform_ratio = 1000;
    world.shake(3);
    world.e.sight.by_platform_g = 3 * 4;
    ASSERT_EQ(world.pass(5), -1);
    world.e.sight.by_platform_g = 3 * 4 * 1.2;
    EXPECT_GE(world.pass(5), 0);
    EXPECT_EQ(world.judge.cause(), GuardCause::over_level);
}

TEST(Judge, AnArmedTableThatMovesByItselfIsFoundThoughNothingExcitesIt) {
    for (const bool has_table : {true, false}) {
        SCOPED_TRACE(has_table);
        World world;
        // GIVEN an excitation that has ended, and the campaign waits, armed
        world.arm(5);
        world.shake(5);
        ASSERT_EQ(world.pass(5), -1);
        world.arm(5, false);
        world.shake(0);
        ASSERT_EQ(world.pass(60), -1);
        // WHEN the table begins to move by itself
        world.shake(5);
        if (!has_table) world.e.sight.has_table = world.e.sight.table.known = false;
        // THEN
        EXPECT_NEAR(world.pass(5), has_table ? safety::kUnarmedMotion_s : 2, 2 * kLook_s);
        EXPECT_EQ(world.judge.cause(), GuardCause::unarmed_motion);
        EXPECT_TRUE(world.judge.stop_wanted());
    }
    World world;
    world.arm(5, false);
    ASSERT_EQ(world.pass(5), -1);
    world.e.shaker = {true, true, 0};  // its controller alone says so
    EXPECT_NEAR(world.pass(5), safety::kUnarmedMotion_s, 2 * kLook_s);
}

TEST(Judge, WhatWasExcitedLastHasItsTimeToComeToRest) {
    World world;
    world.arm(5);
    world.shake(5);
    ASSERT_EQ(world.pass(5), -1);
    world.arm(5, false);
    EXPECT_EQ(world.pass(safety::kStopDeadline_s), -1);
    EXPECT_NEAR(world.pass(5), safety::kUnarmedMotion_s, 2 * kLook_s);
    // and the platform on its pads as much more as it rings
    World pads;
    pads.arm(5);
    pads.shake(5);
    ASSERT_EQ(pads.pass(5), -1);
    pads.arm(5, false);
    pads.e.sight.table = {true, 0.001, 0.001};
    EXPECT_EQ(pads.pass(safety::kStopDeadline_s + safety::kRingDown_s), -1);
    EXPECT_GT(pads.pass(5), 0);
}

TEST(Judge, HandsAndSlewsOnAnArmedPlatformAreNoExcitation) {
    World world;
    world.arm(5, false);
    ASSERT_EQ(world.pass(20), -1);
    world.e.sight.platform = {true, 0.19, 0.5};  // for as long as they like
    EXPECT_EQ(world.pass(600), -1);
    for (int knock = 0; knock < 10; ++knock) {
        world.e.sight.platform = {true, 0.5, 1};
        EXPECT_EQ(world.pass(1.8), -1);
        world.e.sight.platform = {true, 0.01, 0.1};
        EXPECT_EQ(world.pass(0.2), -1);
    }
}

TEST(Judge, RestOfBeforeDoesNotForgetAnArming) {
    // GIVEN a guard that watched a rig at rest before the daemon came
    World world;
    world.talks = false;
    ASSERT_EQ(world.pass(20), -1);
    world.talks = true;
    world.arm(9);
    ASSERT_EQ(world.pass(5), -1);
    // WHEN the daemon dies, armed, the table at rest a moment and then seen by nobody
    world.talks = false;
    ASSERT_EQ(world.pass(safety::kHeartbeatDeadline_s + 1), -1);
    world.blind();
    // THEN that it rested long before is no reason to forget what was armed
    EXPECT_GE(world.pass(2), 0);
    EXPECT_EQ(world.judge.cause(), GuardCause::daemon_silent);
}

TEST(Judge, ADaemonThatFallsSilentAtRestIsNoDanger) {
    World world;
    ASSERT_EQ(world.pass(5), -1);
    world.talks = false;
    EXPECT_EQ(world.pass(60), -1);
    // and when the table moves after that, it is
    world.shake(0.5);
    EXPECT_NEAR(world.pass(5), safety::kUnarmedMotion_s, 2 * kLook_s);
    EXPECT_EQ(world.judge.cause(), GuardCause::daemon_silent);
}

TEST(Judge, AnArmingOfADeadDaemonIsForgottenOnceTheTableRests) {
    World world;
    world.arm(9, false);
    ASSERT_EQ(world.pass(5), -1);
    world.talks = false;
    ASSERT_EQ(world.pass(10), -1);
    world.shake(0.04);  // somebody works at the rig: neither rest nor motion
    EXPECT_EQ(world.pass(30), -1);
}

TEST(Judge, ADaemonThatFallsSilentWhileNothingIsSeenIsTakenForMoving) {
    World world;
    world.arm(9);
    world.shake(9);
    ASSERT_EQ(world.pass(5), -1);
    world.blind();
    world.talks = false;
    EXPECT_NEAR(world.pass(5), safety::kHeartbeatDeadline_s, 2 * kLook_s);
}

TEST(Judge, ADaemonThatWasNeverHeardIsGivenTimeAndThenNotWaitedFor) {
    World world;
    world.talks = false;
    world.e.word.reset();
    world.shake(5);
    EXPECT_NEAR(world.pass(10), 3, 2 * kLook_s);
    EXPECT_EQ(world.judge.cause(), GuardCause::daemon_silent);
}

TEST(Judge, EachStageOfTheDaemonThatHangsIsFound) {
    for (std::size_t stage = 0; stage < 4; ++stage) {
        World world;
        world.arm(9);
        world.shake(9);
        ASSERT_EQ(world.pass(5), -1) << stage;
        world.hangs = stage;
        EXPECT_NEAR(world.pass(5), safety::kProgressDeadline_s, 2 * kLook_s) << stage;
        EXPECT_EQ(world.judge.cause(), GuardCause::daemon_hangs) << stage;
    }
}

TEST(Judge, MotionThatNobodyArmedIsFoundWhateverTheDaemonSays) {
    World world;
    ASSERT_EQ(world.pass(5), -1);
    world.shake(5);
    EXPECT_NEAR(world.pass(5), safety::kUnarmedMotion_s, 2 * kLook_s);
    EXPECT_EQ(world.judge.cause(), GuardCause::unarmed_motion);
    EXPECT_TRUE(world.judge.stop_wanted());
}

TEST(Judge, OneWitnessThatMovesIsEnough) {
    World world;
    ASSERT_EQ(world.pass(5), -1);
    world.e.sight.platform = {true, 3, 4};  // the table's accelerometer is dead and looks at rest
    EXPECT_GT(world.pass(5), 0);
    World other;
    ASSERT_EQ(other.pass(5), -1);
    other.e.shaker = {true, true, 5};  // only the controller says so
    EXPECT_GT(other.pass(5), 0);
    EXPECT_EQ(other.judge.cause(), GuardCause::unarmed_motion);
}

TEST(Judge, AKnockIsNoMotion) {
    World world;
    ASSERT_EQ(world.pass(5), -1);
    world.shake(3);
    EXPECT_EQ(world.pass(safety::kUnarmedMotion_s - 2 * kLook_s), -1);
    world.shake(0);
    EXPECT_EQ(world.pass(10), -1);
}

TEST(Judge, MoreThanTheArmedLevelByOneDecibelIsFoundInHalfASecond) {
    const double one_db = std::pow(10.0, 1.0 / 20);
    World world;
    world.arm(5);
    world.shake(5 * one_db * 0.999);
    ASSERT_EQ(world.pass(30), -1);
    world.shake(5 * one_db * 1.001);
    EXPECT_NEAR(world.pass(5), safety::kOverArmed_s, 2 * kLook_s);
    EXPECT_EQ(world.judge.cause(), GuardCause::over_level);
}

TEST(Judge, AnArmingAboveTheShakersLimitIsNotBelieved) {
    World world;
    world.arm(1e6);
    world.shake(13.4);  // 12 g and 1 dB are 13.46 g
    ASSERT_EQ(world.pass(5), -1);
    world.shake(14);
    EXPECT_GT(world.pass(5), 0);
}

TEST(Judge, AStopThatIsNotObeyedSoundsTheHornAfterItsDeadline) {
    World world;
    world.arm(5);
    world.shake(5);
    world.e.shaker = {true, true, 5};
    ASSERT_EQ(world.pass(5), -1);
    // GIVEN the daemon orders a stop, and the controller says that it has stopped
    world.e.word->stop_ordered = true;
    world.e.shaker = {true, false, 0};
    // WHEN the table shakes on
    EXPECT_NEAR(world.pass(10), safety::kStopDeadline_s, 2 * kLook_s);
    // THEN
    EXPECT_EQ(world.judge.cause(), GuardCause::stop_disobeyed);
    EXPECT_TRUE(world.judge.disobeyed());
    EXPECT_EQ(world.judge.tune(), Tune::disobeyed);
    // AND when somebody has pressed the emergency stop the horn changes its tune, and stays on
    world.shake(0);
    world.pass(1);
    EXPECT_EQ(world.judge.tune(), Tune::stop);
    EXPECT_TRUE(world.judge.disobeyed());
    EXPECT_FALSE(world.judge.stop_wanted());
}

TEST(Judge, ItsOwnStopIsWatchedAsWell) {
    World world;
    world.arm(5);
    world.shake(5);
    ASSERT_EQ(world.pass(5), -1);
    world.talks = false;
    const double found = world.pass(2);
    ASSERT_GT(found, 0);
    EXPECT_FALSE(world.judge.disobeyed());
    world.pass(safety::kStopDeadline_s - 2);
    EXPECT_FALSE(world.judge.disobeyed());
    world.pass(2);
    EXPECT_TRUE(world.judge.disobeyed());
    EXPECT_EQ(world.judge.cause(), GuardCause::daemon_silent) << "the first cause stays";
}

TEST(Judge, ThePlatformMayRingLongerThanTheTable) {
    World world;
    world.arm(5);
    world.shake(5);
    ASSERT_EQ(world.pass(5), -1);
    world.e.word->stop_ordered = true;
    world.e.sight.table = {true, 0.001, 0.001};
    EXPECT_EQ(world.pass(safety::kStopDeadline_s + safety::kRingDown_s), -1);
    EXPECT_GT(world.pass(1), 0);
    EXPECT_TRUE(world.judge.disobeyed());
}

TEST(Judge, AStopThatIsObeyedIsNoFinding) {
    World world;
    world.arm(5);
    world.shake(5);
    ASSERT_EQ(world.pass(5), -1);
    world.e.word->stop_ordered = true;
    ASSERT_EQ(world.pass(2), -1);
    world.shake(0);
    EXPECT_EQ(world.pass(30), -1);
}

TEST(Judge, ARigThatIsSwitchedOffAfterItStoppedIsNotDisobedience) {
    World world;
    ASSERT_EQ(world.pass(5), -1);
    world.shake(5);
    ASSERT_GT(world.pass(1.5), 0);
    world.shake(0);
    world.pass(1);
    world.blind();
    world.e.shaker = {};
    world.pass(60);
    EXPECT_FALSE(world.judge.disobeyed());
    // but one that moves again is
    world.shake(5);
    world.pass(safety::kStopDeadline_s + 1);
    EXPECT_TRUE(world.judge.disobeyed());
}

TEST(Judge, AStopThatNobodySeesObeyedIsNotObeyed) {
    World world;
    world.arm(5);
    world.shake(5);
    ASSERT_EQ(world.pass(5), -1);
    world.e.word->stop_ordered = true;
    world.blind();
    EXPECT_NEAR(world.pass(10), safety::kStopDeadline_s, 2 * kLook_s);
    EXPECT_TRUE(world.judge.disobeyed());
}

TEST(Judge, AStopAtTheStartOfARigThatIsSwitchedOffIsNoFinding) {
    World world;
    world.blind();
    world.e.word->stop_ordered = true;
    EXPECT_EQ(world.pass(60), -1);
}

TEST(Judge, AStopIsOrderedUntilRestIsMeasuredAndRunReadsZero) {
    World world;
    ASSERT_EQ(world.pass(5), -1);
    world.shake(5);
    ASSERT_GT(world.pass(5), 0);
    world.e.shaker = {true, false, 0};
    world.pass(1);
    EXPECT_TRUE(world.judge.stop_wanted()) << "the register alone proves nothing";
    world.shake(0);
    world.e.shaker = {true, true, 0};
    world.pass(1);
    EXPECT_TRUE(world.judge.stop_wanted()) << "nor do the accelerometers alone";
    world.e.shaker = {true, false, 0};
    world.pass(1);
    EXPECT_FALSE(world.judge.stop_wanted());
    world.shake(5);
    world.pass(1);
    EXPECT_TRUE(world.judge.stop_wanted()) << "and it watches on";
}

TEST(Judge, AFindingStaysUntilAPersonHasSeenItAtRest) {
    World world;
    ASSERT_EQ(world.pass(5), -1);
    world.shake(5);
    ASSERT_GT(world.pass(5), 0);
    EXPECT_EQ(world.judge.finding(), kFirst);
    // WHEN it is acknowledged while the table moves
    world.e.word->acknowledged = kFirst;
    world.pass(1);
    EXPECT_NE(world.judge.cause(), GuardCause::none);
    EXPECT_FALSE(world.judge.acknowledge());
    // WHEN another finding is acknowledged at rest
    world.e.word->acknowledged = kFirst - 1;
    world.shake(0);
    world.pass(5);
    EXPECT_NE(world.judge.cause(), GuardCause::none);
    // WHEN this one is
    world.e.word->acknowledged = kFirst;
    world.pass(1);
    EXPECT_EQ(world.judge.cause(), GuardCause::none);
    EXPECT_EQ(world.judge.tune(), Tune::none);
    // THEN the next has a number of its own, which that acknowledgement does not cover
    world.shake(5);
    ASSERT_GT(world.pass(5), 0);
    EXPECT_EQ(world.judge.finding(), kFirst + 1);
    world.shake(0);
    world.pass(5);
    EXPECT_EQ(world.judge.cause(), GuardCause::unarmed_motion);
}

TEST(Judge, ARigThatOwnsTheTimeIsJudgedByItAndByTheWallBoth) {
    // GIVEN a rig at 100 times real time: its second is 10 ms of ours
    World fast(100);
    ASSERT_EQ(fast.pass(5), -1);
    fast.shake(5);
    EXPECT_NEAR(fast.pass(5), safety::kUnarmedMotion_s, 2 * kLook_s) << "words take their time";
    // GIVEN a rig that stands still
    World still;
    still.arm(5);
    still.shake(5);
    ASSERT_EQ(still.pass(5), -1);
    still.rig_goes = false;
    still.hangs = 2;
    EXPECT_EQ(still.pass(60), -1) << "no time passes there, and nothing moves";
    still.rig_goes = true;
    EXPECT_NEAR(still.pass(5), safety::kProgressDeadline_s, 2 * kLook_s);
}

}  // namespace
}  // namespace vibrig::guard
