// A daemon that dies at any step: what it kept is gone on from.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <fstream>

#include "daemon/commission/progress.hpp"
#include "tests/unit/daemon/commission/commissioned.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::commission {
namespace {

using ::testing::HasSubstr;

class Resumed : public Commissioned {
  protected:
    /// To the end, or until so many answers and means are kept; nothing is written meanwhile.
    void run_to(std::size_t entries) {
        if (!procedure->active()) {
            procedure->begin("Ada", false, now);
        }
        for (int n = 0; n < 200'000 && procedure->active() && kept.size() < entries; ++n) {
            now += kSecond / 10;
            procedure->attend("Ada", now);
            procedure->step(now, now);
            const Question* question = procedure->asks();
            if (question == nullptr || kept.size() >= entries) continue;
            const std::string id = question->id;
            EXPECT_EQ(procedure->answer("Ada", id, answer_to(id, question->text)), "");
        }
    }

    /// Another daemon; the rig stands where it was, and drifts on if it was let go.
    void die() {
        procedure = std::make_unique<Procedure>(names(), Stated{0, 2, true}, wired, wired);
        now += 60 * kSecond;
        arrives = now;
    }

    void rig_again(std::uint64_t seed) {
        rig_of(seed);
        kept = Json::array();
        asked.clear();
        beyond = {};
    }

    Kept what_is_kept(const std::string& again = {}) { return {kept, {}, again}; }
};

TEST_F(Resumed, AtEveryStepNothingMovesWithoutAPermissionAndTheResultIsTheSame) {
    rig_again(2);
    const Json whole = run()["result"];
    ASSERT_EQ(whole["outcome"], "decided") << whole.dump(1);
    const std::size_t entries = kept.size();
    ASSERT_GT(entries, 60U);
    // All of them: VIBRIG_EVERY_STEP=1.
    const std::size_t stride = std::getenv("VIBRIG_EVERY_STEP") != nullptr ? 1 : 7;
    for (std::size_t at = 0; at < entries; at += stride) {
        SCOPED_TRACE("dies after " + std::to_string(at) + " of " + std::to_string(entries));
        rig_again(2);
        run_to(at);
        ASSERT_EQ(kept.size(), at);
        die();
        const int before = slews, let_go = released;
        procedure->begin_again("Ada", false, what_is_kept(), now);
        asked.clear();
        EXPECT_EQ(kept.size(),
                  at > 0 && procedure->state(0)["lines"].dump().find("anew") == std::string::npos
                      ? at
                      : 0);
        bool permitted = false;
        while (procedure->active() && !permitted) {
            now += kSecond / 10;
            procedure->attend("Ada", now);
            procedure->step(now, now);
            const auto id = question();
            permitted = id.starts_with("permit");
            if (permitted) break;
            ASSERT_NE(id, "") << "it acts by itself: " << procedure->state(0).dump(1);
            ASSERT_EQ(procedure->answer("Ada", id, answer_to(id, "")), "");
            // The first look needs no permission.
            for (int n = 0; n < 200 && question().empty() && procedure->active(); ++n) {
                now += kSecond / 10;
                procedure->attend("Ada", now);
                procedure->step(now, now);
            }
        }
        ASSERT_EQ(slews, before);
        ASSERT_EQ(released, let_go);
        if (kept.size() < at) based = false;  // it begins where it stands
        const Json result = run()["result"];
        ASSERT_EQ(result["outcome"], "decided") << result.dump(1);
        ASSERT_EQ(result["found"]["platform.encoder_sign"],
                  whole["found"]["platform.encoder_sign"]);
        const auto was = whole["found"]["platform.encoder_zero_deg"].get<Vec3>();
        const auto is = result["found"]["platform.encoder_zero_deg"].get<Vec3>();
        for (std::size_t i = 0; i < 3; ++i)
            ASSERT_LT(std::abs(std::remainder(is[i] - was[i], 360.0)), 0.1);
        ASSERT_LT(std::abs(std::remainder(result["found"]["site.azimuth_deg"].get<double>() -
                                              whole["found"]["site.azimuth_deg"].get<double>(),
                                          360.0)),
                  0.6);
    }
}

/// A gimbal that stands at its stop says that it is in position: what was found of it outlives the
/// daemon, so that nothing is sent into the stop a second time.
TEST_F(Resumed, ASoftStopThatWasMetIsKept) {
    const std::vector<double> at_stop{140, 18, 178};
    const auto with_a_stop = [&] {
        rig_again(2);
        rig->travel_deg = {at_stop[0], at_stop[1], at_stop[2]};
        answers["travel"] = "-130 130 -30 30 -175 175";
    };
    with_a_stop();
    const Json whole = run();
    ASSERT_EQ(whole["result"]["outcome"], "decided") << whole.dump(1);
    ASSERT_THAT(whole["lines"].dump(), HasSubstr("a soft stop?"));
    const std::size_t entries = kept.size();
    int with_it = 0;
    for (std::size_t at = 20; at < entries; at += 3) {
        SCOPED_TRACE("dies after " + std::to_string(at) + " of " + std::to_string(entries));
        with_a_stop();
        run_to(at);
        // Each side of it; the second is met later.
        std::array<bool, 2> met{};
        for (const Json& entry : kept)
            if (entry.contains("short")) met[entry["short"][1].get<double>() > 0 ? 1 : 0] = true;
        die();
        procedure->begin_again("Ada", false, what_is_kept(), now);
        if (procedure->state(0)["lines"].dump().find("anew") != std::string::npos) continue;
        beyond = {};
        const Json result = run()["result"];
        ASSERT_EQ(result["outcome"], "decided") << result.dump(1);
        for (std::size_t side = 0; side < 2; ++side)
            EXPECT_TRUE(!met[side] || beyond[side] == 0) << "into the stop again, side " << side;
        for (std::size_t g = 0; g < 3; ++g)
            for (std::size_t end = 0; end < 2; ++end)
                EXPECT_NEAR(result["found"]["gimbal.travel_deg"][g][end].get<double>(),
                            whole["result"]["found"]["gimbal.travel_deg"][g][end].get<double>(),
                            0.15)  // written to 0.1
                    << g;
        with_it += met[0] || met[1] ? 1 : 0;
    }
    EXPECT_GT(with_it, 5);
}

TEST_F(Resumed, WhatWasMeasuredAllIsDecidedWithoutAMove) {
    rig_again(3);
    const Json whole = run()["result"];
    die();
    const int before = slews;
    procedure->begin_again("Ada", false, what_is_kept(), now);
    EXPECT_FALSE(procedure->active());
    EXPECT_EQ(procedure->state(0)["result"], whole) << "to the bit";
    EXPECT_EQ(slews, before);
}

TEST_F(Resumed, ARigThatWasMovedMeanwhileBeginsAnew) {
    rig_again(2);
    procedure->begin("Ada", false, now);
    run_until(
        [this] { return procedure->state(0)["lines"].dump().find("C  ") != std::string::npos; });
    run_to(kept.size() + 8);
    die();
    procedure->begin_again("Ada", false, what_is_kept(), now);
    rig->zero_g[0] += 0.02;
    const Json state = run(false, "power");
    ASSERT_EQ(state["question"]["id"], "power") << state.dump(1);
    EXPECT_THAT(state["lines"].dump(),
                HasSubstr("mg off the one measured in this position: it begins anew"));
}

TEST_F(Resumed, WhatMakesNoSenseBeginsAnew) {
    for (const char* log :
         {"[]", "[1]", "[{}]", R"([{"id":"power"}])",
          R"([{"id":"power","value":"yes"},{"angle":3}])", R"([{"id":"power","value":7}])",
          R"([{"id":"travel","value":"yes"}])", "{}", "null"}) {
        SCOPED_TRACE(log);
        rig_again(1);
        const int before = slews;
        Kept bad{Json::parse(log), {}, {}};
        procedure->begin_again("Ada", false, bad, now);
        EXPECT_EQ(question(), "power");
        pass(3);
        EXPECT_EQ(slews, before);
    }
}

TEST_F(Resumed, AFileThatSomebodyHasWrittenOtherwiseIsNothingToGoOnWith) {
    const TemporaryFolder folder;
    const Progress progress(folder.string(), "a rig");
    constexpr std::int64_t kNow = 1'795'000'000'000'000'000;
    progress.write("Ada", false, Json::array(), kNow);
    ASSERT_EQ(progress.read("Ada", false, kNow).why_not, "");
    std::ifstream in(folder / "progress.json");
    const Json written = Json::parse(in);
    for (const auto& [key, value] : written.items()) {
        if (key == "rig") continue;
        for (const Json& other : {Json(), Json("x"), Json(5), Json(false), Json{{"a", 1}}}) {
            if (other.type() == value.type() || (value.is_number() && other.is_number())) continue;
            Json bad = written;
            bad[key] = other;
            std::ofstream(folder / "progress.json") << bad;
            std::string why_not;
            ASSERT_NO_THROW(why_not = progress.read("Ada", false, kNow).why_not) << bad;
            EXPECT_THAT(why_not, HasSubstr("not what vibrigd wrote")) << bad;
        }
    }
}

TEST_F(Resumed, OneWitnessIsAskedAgainAndNothingElseIsMeasured) {
    for (const char* again : {"latitude", "compass", "drawing", "sense"}) {
        SCOPED_TRACE(again);
        rig_again(4);
        answers = {{"compass", "-"}, {"drawing", "-"}, {"anticlockwise", "-"}};
        const Json first = run()["result"];
        ASSERT_EQ(first["outcome"], "undecided") << "one witness is none";
        EXPECT_THAT(first["why"].get<std::string>(),
                    HasSubstr("; what would tell: compass, drawing, sense (vibrig commission "
                              "--ask compass)"));
        const auto stops = kept.size();
        die();
        answers.clear();
        procedure->begin_again("Ada", false, what_is_kept(again), now);
        asked.clear();
        const Json second = run()["result"];
        EXPECT_THAT(asked,
                    ::testing::Contains(again == std::string("sense") ? "anticlockwise" : again));
        for (const char* other : {"permit.outer", "which.outer", "power"})
            EXPECT_THAT(asked, ::testing::Not(::testing::Contains(other)));
        EXPECT_LE(kept.size(), stops + 4);
        // Two that agree.
        const bool enough = again != std::string("latitude");
        EXPECT_EQ(second["outcome"], enough ? "decided" : first["outcome"]) << second.dump(1);
        if (!enough) continue;
        // And once more, of what is kept: to the bit.
        die();
        procedure->begin_again("Ada", false, what_is_kept(), now);
        EXPECT_EQ(procedure->state(0)["result"], second);
    }
}

TEST_F(Resumed, ByHandItGoesOnWhereItWas) {
    rig_again(5);
    rig->by_hand = true;
    procedure->begin("Ada", true, now);
    run_to(40);
    die();
    procedure->begin_again("Ada", true, what_is_kept(), now);
    const Json result = run(true)["result"];
    EXPECT_EQ(result["outcome"], "decided") << result.dump(1);
    EXPECT_EQ(slews + released, 0);
}

TEST_F(Resumed, AScriptAnswersAtOnceWhileSomebodyIsThere) {
    rig_again(2);
    procedure->answer_all({{"power", "yes"}, {"travel", "free free free"}});
    procedure->begin("Ada", false, now);
    pass(10, "");
    EXPECT_EQ(question(), "power") << "nobody is at the tool";
    pass(0.3);
    EXPECT_NE(question(), "power");
    pass(10);
    EXPECT_EQ(question(), "permit.hold") << "the script does not say, and nothing else is usual";
}

}  // namespace
}  // namespace vibrig::commission
