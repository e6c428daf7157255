// What moves, for whom, and what stops it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/daemon/commission/commissioned.hpp"

namespace vibrig::commission {
namespace {

using ::testing::HasSubstr;

class Moved : public Commissioned {
  protected:
    /// Into the sweeps: a gimbal moves, for seconds.
    void into_a_sweep() {
        rig_of(1);
        procedure->begin("Ada", false, now);
        run_until([this] {
            return most_travel[0] > 40 && procedure->moves() && arrives > now + kSecond;
        });
    }
    /// Into a mean of a sweep: all gimbals stand.
    void into_a_mean() {
        into_a_sweep();
        run_until([this] { return !procedure->moves(); });
        pass(1);
    }
};

TEST_F(Moved, NothingMovesBeforeAPermissionOrAfterANo) {
    rig_of(1);
    static_cast<void>(run(false, "permit.hold"));
    EXPECT_EQ(slews, 0);
    EXPECT_EQ(procedure->answer("Ada", "permit.hold", "perhaps"),
              "found \"perhaps\", expected yes or no");
    EXPECT_EQ(procedure->answer("Ada", "permit.hold", "no"), "");
    EXPECT_FALSE(procedure->active());
    EXPECT_EQ(slews, 0);
    EXPECT_EQ(procedure->state(0)["result"]["outcome"], "unfinished");
}

TEST_F(Moved, WithNobodyAtTheToolItStopsAndGoesOnByPermissionOnly) {
    rig_of(1);
    static_cast<void>(run(false, "permit.outer"));
    EXPECT_EQ(procedure->answer("Ada", "permit.outer", "yes"), "");
    // Into the sweeps, where moves take seconds.
    const int before = slews;
    while (slews < before + 25 && procedure->active()) {
        now += kSecond / 20;
        procedure->attend("Ada", now);
        procedure->step(now, now);
        if (procedure->asks() == nullptr) continue;
        const std::string id = question();
        ASSERT_EQ(procedure->answer("Ada", id, answer_to(id, "")), "");
    }
    ASSERT_TRUE(procedure->active());
    attended = false;
    const Json state = run(false, "go_on");
    ASSERT_EQ(state["question"]["id"], "go_on") << state.dump(1);
    const int stopped = slews;
    for (int n = 0; n < 200; ++n) {
        now += kSecond / 20;
        procedure->step(now, now);
    }
    EXPECT_EQ(slews, stopped);
    attended = true;
    EXPECT_EQ(run()["result"]["outcome"], "decided");
}

TEST_F(Moved, ACommandThatIsAnotherAngleThanTheReadingStopsAtOnce) {
    rig_of(1);
    offset_deg = 20;
    const Json result = run()["result"];
    EXPECT_EQ(result["outcome"], "undecided");
    EXPECT_THAT(result["why"].get<std::string>(), HasSubstr("by hand"));
    EXPECT_EQ(slews, 1);
    EXPECT_GE(released, 1);
}

TEST_F(Moved, ACommandInTurnsIsSeenAtASmallMove) {
    rig_of(1);
    gain = 360;
    const Json result = run()["result"];
    EXPECT_EQ(result["outcome"], "undecided");
    EXPECT_THAT(result["why"].get<std::string>(), HasSubstr("stopped"));
    EXPECT_LT(std::max({most_travel[0], most_travel[1], most_travel[2]}), 30);
}

TEST_F(Moved, AChannelThatFallsSilentStopsAMove) {
    into_a_sweep();
    const int before = slews;
    good = false;
    pass(0.2);
    EXPECT_EQ(question(), "go_on");
    good = true;
    pass(10);
    EXPECT_LE(slews, before + 1) << "it holds";
    EXPECT_EQ(procedure->answer("Ada", "go_on", "yes"), "");
    EXPECT_EQ(run()["result"]["outcome"], "decided");
}

TEST_F(Moved, ARealRigIsMovedByCommandWhereAPersonSaysThatItCountsInDegrees) {
    for (const char* said : {"no", "yes"}) {
        rig_of(1);
        procedure = std::make_unique<Procedure>(names(), Stated{0, 2, false}, wired, wired);
        procedure->begin("Ada", false, now);
        pass(1);
        EXPECT_EQ(procedure->answer("Ada", "power", "yes"), "");
        ASSERT_EQ(question(), "degrees");
        EXPECT_EQ(procedure->answer("Ada", "degrees", said), "");
        EXPECT_EQ(procedure->active(), std::string(said) == "yes");
        EXPECT_EQ(slews + released, 0);
    }
    EXPECT_EQ(question(), "travel");
}

TEST_F(Moved, SomebodyElseAtAnotherToolIsNobodyHere) {
    into_a_sweep();
    const int before = slews;
    pass(3, "status");
    EXPECT_EQ(question(), "go_on") << "Ada is gone";
    pass(5, "Bo (uid 1000)");
    EXPECT_EQ(slews, before + 1) << "it holds";
    EXPECT_THAT(procedure->answer("Bo (uid 1000)", "go_on", "yes"),
                HasSubstr("Ada commissions it, and answers: found Bo"));
    EXPECT_EQ(procedure->answer("ada (uid 1000)", "go_on", "yes"), "") << "the same person";
    EXPECT_TRUE(procedure->moves());
}

TEST_F(Moved, AnAnswerIsKeptWithWhoGaveIt) {
    rig_of(1);
    procedure->begin("Ada", false, now);
    EXPECT_EQ(procedure->answer("Ada (uid 0)", "power", "yes"), "");
    ASSERT_FALSE(events.empty());
    EXPECT_EQ(events.back(), "Is the shaker's power stage off? yes, says Ada (uid 0)");
}

TEST_F(Moved, WhoIsGoneStopsAMeanToo) {
    into_a_mean();
    const int before = slews;
    pass(3, "");
    EXPECT_EQ(question(), "go_on");
    EXPECT_EQ(slews, before);
}

TEST_F(Moved, NothingIsReleasedThatWasNeverCommanded) {
    rig_of(1);
    answers["stop"] = "release";
    procedure->begin("Ada", false, now);
    run_until([] { return true; });  // the first look
    procedure->stop("by Ada", now);
    EXPECT_EQ(released, 0);
    EXPECT_EQ(procedure->answer("Ada", "go_on", "no"), "");
    EXPECT_FALSE(procedure->active());
    EXPECT_EQ(released + slews, 0);
}

TEST_F(Moved, AStopThatReleasesDoesSoWhereAllStandAndGoesBackBeforeItMeasures) {
    answers["stop"] = "release";
    into_a_mean();
    const int before = slews;
    procedure->stop("by Ada", now);
    EXPECT_EQ(released, 1);
    EXPECT_EQ(procedure->answer("Ada", "go_on", "yes"), "");
    EXPECT_EQ(slews, before + 1) << "back to where it is measured";
    EXPECT_EQ(run()["result"]["outcome"], "decided");
}

TEST_F(Moved, WhatWasPushedMeanwhileDoesNotGoTheLongWayRound) {
    answers["stop"] = "release";
    rig_of(1);
    procedure->begin("Ada", false, now);
    run_until([this] { return most_travel[2] > 110 && !procedure->moves(); });
    procedure->stop("by Ada", now);
    ASSERT_EQ(released, 1);
    travel[2] -= 175;  // by hand
    rig->go(travel);
    drift = rig->drift();
    pass(1);
    EXPECT_EQ(procedure->answer("Ada", "go_on", "yes"), "");  // slew() holds it to one way round
    EXPECT_EQ(run()["result"]["outcome"], "decided");
}

TEST_F(Moved, AStopInAFreeDriftBeginsTheDriftAnew) {
    rig_of(1);
    procedure->begin("Ada", false, now);
    run_until([this] { return released == 2 && !procedure->moves(); });
    pass(10);
    const int before = slews;
    procedure->stop("by Ada", now);
    pass(3600);  // 10 deg and more
    EXPECT_EQ(procedure->answer("Ada", "go_on", "yes"), "");
    EXPECT_EQ(slews, before + 1);
    const Json result = run()["result"];
    EXPECT_EQ(result["outcome"], "decided") << result.dump(1);
}

TEST_F(Commissioned, ASoftStopIsReportedWithItsGimbalAndATravelWithinItIsScaledInto) {
    int ended = 0;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        // Says that it is in position where its stop is.
        rig_of(seed);
        const std::size_t short_one = seed % 3;
        rig->travel_deg = {140, 35, 178};
        rig->travel_deg[short_one] = short_one == 1 ? 18 : 60;
        answers["travel"] = "-130 130 -30 30 -175 175";
        const Json state = run();
        constexpr std::array<const char*, 3> kLoud{"OUTER", "INNER", "AZIMUTH"};
        EXPECT_THAT(state["lines"].get<std::vector<std::string>>(),
                    ::testing::Contains(::testing::AllOf(
                        HasSubstr(std::string("the ") + kLoud[short_one] + " gimbal stands"),
                        HasSubstr("a soft stop?"))));
        const Json& result = state["result"];
        EXPECT_NE(result["outcome"], "refused") << result["why"];
        if (result["outcome"] != "decided") {
            EXPECT_FALSE(result["why"].get<std::string>().empty());
            EXPECT_TRUE(result["found"].empty());
            continue;
        }
        ++ended;
        // The travel that is written is shorter than the one that was stated, in degrees whatever
        // the readings count in.
        constexpr std::array<double, 3> kStated{260, 60, 350};
        const auto& found = result["found"];
        ASSERT_TRUE(found.contains("gimbal.travel_deg")) << found.dump();
        for (std::size_t g = 0; g < 3; ++g) {
            const auto& of = found["gimbal.travel_deg"][g];
            const double wide = of[1].get<double>() - of[0].get<double>();
            if (g == short_one)
                EXPECT_LT(wide, kStated[g] - 1) << g;
            else
                EXPECT_NEAR(wide, kStated[g], 0.03 * kStated[g]) << g;
        }
    }
    EXPECT_GE(ended, 10);
    // The travel that it has is stated: sweeps and positions are scaled into it.
    int decided = 0;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        rig_of(seed);
        most_travel = {};
        rig->travel_deg = {60, 20, 70};
        answers["travel"] = "-60 60 -20 20 -70 70";
        const Json result = run()["result"];
        for (std::size_t k = 0; k < 3; ++k) EXPECT_LE(most_travel[k], rig->travel_deg[k] + 1e-9);
        EXPECT_NE(result["outcome"], "refused") << result["why"];
        if (result["outcome"] == "decided") ++decided;
        if (result["outcome"] == "undecided") {
            EXPECT_FALSE(result["why"].get<std::string>().empty());
            EXPECT_TRUE(result["found"].empty());
        }
    }
    EXPECT_GE(decided, 10);
}

/// Encoders count from 0 to 360, or from wherever: with a reading of 353 deg at the start 383 would
/// be no value of the key.
TEST_F(Commissioned, TheTravelThatIsFoundIsOneThatTheConfigurationTakes) {
    int beyond_a_turn = 0;
    for (std::uint64_t seed = 1; seed <= 12; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        rig_of(seed);
        const auto start = rig->reading_at(rig->angle_deg());
        const Json result = run()["result"];
        if (result["outcome"] != "decided") continue;
        const Json& found = result["found"]["gimbal.travel_deg"];
        for (std::size_t g = 0; g < 3; ++g) {
            const auto channel = static_cast<std::size_t>(rig->channel[g]);
            const double reading = rig->degrees[g] * start[channel];
            const double most = rig->travel_deg[g];
            const auto low = found[g][0].get<double>(), high = found[g][1].get<double>();
            EXPECT_GE(low, -360);
            EXPECT_LE(high, 360);
            // Of the same cables: each end as far from the start as it was stated, in deg.
            const double turns = std::round(((low + high) / 2 - reading) / 360);
            const double tolerance = 0.2 + 0.001 * most;  // written to 0.1; the ratio measured
            EXPECT_NEAR(low, reading + 360 * turns - most, tolerance);
            EXPECT_NEAR(high, reading + 360 * turns + most, tolerance);
            beyond_a_turn += std::abs(reading) + most > 360 ? 1 : 0;
        }
    }
    EXPECT_GT(beyond_a_turn, 3);
}

}  // namespace
}  // namespace vibrig::commission
