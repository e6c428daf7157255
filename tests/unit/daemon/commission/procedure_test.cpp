#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

#include "tests/unit/daemon/commission/commissioned.hpp"

namespace vibrig::commission {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

/// Of the keys found, against the truth.
void expect_right(const UnknownRig& rig, const Json& result, bool commanded = true) {
    const Json& found = result["found"];
    std::array<std::size_t, 3> channel{0, 1, 2};
    for (std::size_t g = 0; g < 3; ++g)
        if (const auto key = std::string("can.signals.") + kGimbals[g]; found.contains(key))
            channel[g] = static_cast<std::size_t>(found[key].get<std::string>()[0] - 'A');
    for (std::size_t g = 0; g < 3; ++g)
        ASSERT_EQ(static_cast<int>(channel[g]), rig.channel[g]) << result.dump(1);
    const auto sign = found["platform.encoder_sign"].get<std::array<int, 3>>();
    const auto zero = found["platform.encoder_zero_deg"].get<Vec3>();
    const auto matrix = found["accelerometer.matrix"].get<std::array<Vec3, 3>>();
    const auto zero_g = found["accelerometer.zero_g"].get<Vec3>();
    EXPECT_EQ(sign[0], 1);
    plant::Random random(1, 1);
    double worst = 0;
    for (int n = 0; n < 20; ++n) {
        const plant::Vec3 at{360 * random.uniform(), 60 * (random.uniform() - 0.5),
                             360 * random.uniform()};
        const auto reading = rig.reading_at(at);
        const auto force = rig.force_at(at);
        Eigen::Vector3d angles;
        for (std::size_t g = 0; g < 3; ++g)
            angles[static_cast<int>(g)] =
                sign[g] * (rig.degrees[g] * reading[channel[g]] - zero[g]) * M_PI / 180;
        const auto up = estimator::commissioning::up_at(
            angles, found["site.elevation_deg"].get<double>() * M_PI / 180);
        for (std::size_t i = 0; i < 3; ++i) {
            double platform = 0;
            for (std::size_t k = 0; k < 3; ++k) platform += matrix[i][k] * (force[k] - zero_g[k]);
            worst = std::max(worst, std::abs(platform - up[static_cast<int>(i)]));
        }
    }
    EXPECT_LT(worst, 4e-3) << result.dump(1);
    Eigen::Matrix3d m;
    for (int i = 0; i < 3; ++i)
        for (int k = 0; k < 3; ++k)
            m(i, k) = matrix[static_cast<std::size_t>(i)][static_cast<std::size_t>(k)];
    EXPECT_EQ(m.determinant() > 0, rig.right_handed());
    // Counted about the other end of the outer axis, azimuth + 180.
    const double turned = rig.sign[0] == 1 ? 0 : 180;
    if (std::abs(rig.truth.latitude_deg) < 70) {
        EXPECT_LT(
            std::abs(std::remainder(
                found["site.azimuth_deg"].get<double>() - rig.truth.azimuth_deg - turned, 360.0)),
            1.0);
    }
    // Of the DBC: what does not count in deg, and what turns the other way.
    std::size_t wrong = 0;
    for (std::size_t g = 0; g < 3; ++g) {
        if (rig.degrees[g] != 1) ++wrong;
        if (commanded && rig.sign[g] * rig.direction[g] != 1) ++wrong;
    }
    EXPECT_EQ(result["corrections"].size(), wrong) << result["corrections"].dump(1);
}

TEST_F(Commissioned, EachStepIsNotedForTheJournalAndNoEventNamesItsSourceTwice) {
    rig_of(1);
    ASSERT_EQ(run()["result"]["outcome"], "decided");
    std::map<std::string, int> count;
    std::string steps;
    for (const Note& note : notes) {
        ++count[note.what];
        EXPECT_EQ(note.by, "Ada");
        EXPECT_EQ(note.part, note.step == "F" ? "earth" : "gimbals");
        if (!steps.ends_with(note.step)) steps += note.step;
    }
    EXPECT_THAT(steps, ::testing::StartsWith("ABCD"));
    EXPECT_THAT(steps, ::testing::EndsWith("F"));
    EXPECT_EQ(count["begin"], 1);
    EXPECT_EQ(count["verdict"], 1);
    EXPECT_EQ(count["hypothesis"], 1);
    EXPECT_EQ(count["permission"] + count["answer"], count["question"]);
    EXPECT_GE(count["permission"], 5);  // power, hold, three gimbals
    EXPECT_EQ(count["move"], slews);
    EXPECT_GE(count["reading"], 23);
    EXPECT_EQ(notes.back().data["outcome"], "decided");
    for (const auto& event : events) EXPECT_THAT(event, Not(HasSubstr("commissioning:")));
}

TEST_F(Commissioned, RandomRigsAreNamedRightOrNotAtAll) {
    int decided = 0, minutes = 0, senses = 0;
    constexpr std::uint64_t kRigs = 24;
    for (std::uint64_t seed = 1; seed <= kRigs; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        rig_of(seed);
        const Time began = now;
        const Json state = run();
        minutes = std::max(minutes, static_cast<int>((now - began) / (60 * kSecond)));
        if (state["result"]["outcome"] != "decided") {
            // Nothing is wrong with it but that north is too near the pole for anybody to tell.
            EXPECT_THAT(state["result"]["why"].get<std::string>(), HasSubstr("inverted or not"));
            continue;
        }
        ++decided;
        double drawing = 0, sense = 0, all = 0;
        for (const auto& witness : state["result"]["witnesses"]) {
            all += witness["ln_odds"].get<double>();
            if (witness["name"] == "drawing") drawing = witness["ln_odds"];
            if (witness["name"] == "sense") sense = witness["ln_odds"];
        }
        EXPECT_GE(drawing * sense, 0) << "true witnesses";
        // Whichever parity the fit began with.
        EXPECT_GT(all, 0);
        EXPECT_GE(sense, 0) << "for what was decided";
        senses += sense != 0 ? 1 : 0;
        expect_right(*rig, state["result"]);
        for (std::size_t i = 0; i < 3; ++i) EXPECT_LE(most_travel[i], 175 + 1e-9);
    }
    EXPECT_GE(decided, 22);
    EXPECT_GE(senses, 20);
    EXPECT_LE(minutes, 15);
}

TEST_F(Commissioned, ByHandNothingIsCommanded) {
    torquers = Eigen::Matrix3d::Identity();
    for (const std::uint64_t seed : {3U, 5U, 8U}) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        rig_of(seed);
        rig->by_hand = true;
        const Json state = run(true);
        ASSERT_EQ(state["result"]["outcome"], "decided") << state["result"].dump(1);
        expect_right(*rig, state["result"], false);
        EXPECT_THAT(state["lines"].dump(), HasSubstr("G  not torqued, moved by hand"));
        EXPECT_THAT(state["result"]["evidence"]["torquers"].dump(), HasSubstr("moved by hand"));
    }
    EXPECT_EQ(torques, 0);
    EXPECT_EQ(slews, 0);
    EXPECT_EQ(released, 0);
}

TEST_F(Commissioned, AChannelThatDoesNotChangeIsReportedAtTheFirstLook) {
    for (const int one : {-1, 2}) {
        rig_of(4);
        based = false;
        travel = {};
        sticks = one;
        const std::string lines = run(false, "permit.hold")["lines"].dump();
        EXPECT_EQ(lines.find("Z has not changed while its neighbours did") != std::string::npos,
                  one == 2)
            << lines;
        EXPECT_EQ(lines.find("X has not changed"), std::string::npos);
    }
}

TEST_F(Commissioned, WhatWasFoundIsAConfigurationWithItsEvidence) {
    rig_of(3);
    ASSERT_EQ(run()["result"]["outcome"], "decided");
    const std::string toml = to_toml(procedure->finding(), true);
    EXPECT_THAT(toml, HasSubstr("[platform]\n# SIMULATED: convention"));
    EXPECT_THAT(toml, HasSubstr("\nencoder_sign = ["));
    EXPECT_THAT(toml, HasSubstr("# SIMULATED: ln LR "));
}

TEST_F(Commissioned, WhatIsStuckOrDeadIsNamed) {
    rig_of(4);
    rig->stuck = 1;
    Json result = run()["result"];
    EXPECT_EQ(result["outcome"], "undecided");
    EXPECT_THAT(result["why"].get<std::string>(), HasSubstr("INNER"));
    EXPECT_EQ(result["suspects"][0], "gimbal.message");
    rig_of(4);
    based = false;
    travel = {};
    rig->dead = 2;
    result = run()["result"];
    EXPECT_EQ(result["outcome"], "refused");
    EXPECT_THAT(result["why"].get<std::string>(), HasSubstr("accelerometer.z"));
    EXPECT_EQ(result["suspects"], Json({"can.signals.accel_z"}));
    EXPECT_TRUE(result["found"].empty());
}

/// The kernel stamps each sample; counts of a clock that lies do not fit them.
TEST_F(Commissioned, ASampleRateThatIsNotTheConfiguredOneEndsItBeforeAnythingMoves) {
    sample_rate = {80.3, 40,
                   "80.3 samples/s measured, can.sample_rate_hz = 40: expected within 1 %"};
    rig_of(4);
    const Json result = run()["result"];
    EXPECT_EQ(result["outcome"], "refused");
    EXPECT_THAT(result["why"].get<std::string>(), HasSubstr("80.3 samples/s measured"));
    EXPECT_EQ(result["suspects"][0], "can.sample_rate_hz");
    EXPECT_EQ(slews, 0);
    EXPECT_TRUE(result["found"].empty());
}

TEST_F(Commissioned, WhatTheBusIsCalledIsFoundToo) {
    sample_rate = {40.01, 40, ""};
    rig_of(3);
    const Json state = run();
    EXPECT_THAT(state["lines"].dump(), HasSubstr("A  40.0 samples/s, 6 channels, |f| = "));
    const Json found = state["result"]["found"];
    ASSERT_EQ(state["result"]["outcome"], "decided");
    EXPECT_TRUE(state["result"]["suspects"].empty());
    EXPECT_EQ(found["can.dbc"], "rig.dbc");
    EXPECT_EQ(found["can.sample_rate_hz"], 40);
    EXPECT_EQ(found["can.signals.accel_x"], "X");
    std::string channels;
    for (const char* const gimbal : kGimbals)
        channels += found[std::string("can.signals.") + gimbal].get<std::string>();
    for (std::size_t g = 0; g < 3; ++g)
        EXPECT_EQ(channels[g], "ABC"[static_cast<std::size_t>(rig->channel[g])]);
    EXPECT_THAT(state["result"]["found_by"]["can.sample_rate_hz"].get<std::string>(),
                HasSubstr("40.01 samples/s"));
}

TEST_F(Commissioned, ALatitudeOfTheOtherHemisphereIsNotBelieved) {
    int outvoted = 0;
    for (std::uint64_t seed = 2; seed <= 10; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        rig_of(seed);
        if (std::abs(rig->truth.latitude_deg) < 10) continue;  // nothing tells it there
        // The compass is right, and with drawing and sense it is three against one.
        answers["latitude"] = std::to_string(-rig->truth.latitude_deg);
        const Json result = run()["result"];
        EXPECT_EQ(result["outcome"], "undecided") << result.dump(1);
        EXPECT_TRUE(result["found"].empty()) << result["found"].dump(1);
        const std::string why = result["why"];
        if (why.find("site.latitude_deg") == std::string::npos) continue;  // too few witnesses
        ++outvoted;
        EXPECT_THAT(why, HasSubstr(std::string("the ") +
                                   (rig->truth.latitude_deg > 0 ? "northern" : "southern") +
                                   " hemisphere measured"));
        EXPECT_THAT(why, HasSubstr("drawing +3.7"));
        EXPECT_THAT(why, HasSubstr("latitude -"));
        EXPECT_EQ(result["suspects"], Json({"site.latitude_deg"}));
    }
    EXPECT_GE(outvoted, 4);
}

TEST_F(Commissioned, AWordAgainstAMeasurementStopsItAndBothAreShown) {
    rig_of(6);
    answers["which.outer"] = "inner";
    answers["which.inner"] = "outer";
    const Json result = run()["result"];
    EXPECT_EQ(result["outcome"], "refused");
    EXPECT_THAT(result["why"].get<std::string>(), HasSubstr("gravity says"));
    EXPECT_EQ(result["suspects"].size(), 3U);
    EXPECT_TRUE(result["found"].empty());
}

TEST_F(Commissioned, AnswersThatAreNoneGetWhatWasExpected) {
    rig_of(1);
    static_cast<void>(run(false, "travel"));
    EXPECT_THAT(procedure->answer("Ada", "travel", "1 2 3"),
                HasSubstr("expected for each gimbal free, or two numbers"));
    EXPECT_THAT(procedure->answer("Ada", "travel", "free -30 30 free 1"),
                HasSubstr("nothing after"));
    EXPECT_THAT(procedure->answer("Ada", "travel", "-500 500 -30 30 -175 175"),
                HasSubstr("expected"));
    EXPECT_THAT(procedure->answer("Ada", "stop", "hold"), HasSubstr("asked is \"travel\""));
    EXPECT_EQ(procedure->answer("Ada", "travel", ""), "");
    EXPECT_THAT(procedure->answer("Ada", "stop", "x"), HasSubstr("expected hold or release"));
}

}  // namespace
}  // namespace vibrig::commission
