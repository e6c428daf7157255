#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "daemon/plan/plan_file.hpp"
#include "tests/unit/support/vibrig_command.hpp"

namespace {

using Json = nlohmann::json;

constexpr const char* kTable1 =
    "alpha_deg,beta_deg,gamma_deg\n0,0,0\n0,0,45\n0,0,90\n0,0,180\n180,0,45\n45,0,0\n45,0,90\n"
    "90,0,90\n90,0,180\n180,0,270\n270,0,0\n270,0,90\n-45,0,0\n-45,0,90\n";

class PlanCommand : public vibrig::test::VibrigCommand {
  protected:
    Json json() const { return Json::parse(out); }
};

TEST_F(PlanCommand, MakesPlansWhoseFileComesBackUnchanged) {
    // WHEN a plan is made, with picture and file
    ASSERT_EQ(vibrig("plan --runs 20 --json -o plan.json --plot sphere.svg"), 0) << error;
    const Json plan = json();
    // THEN it has the keys of the contract
    EXPECT_GE(plan["d_efficiency"], 0.985);
    EXPECT_LE(plan["bound"], plan["d_efficiency"]);
    EXPECT_EQ(plan["rank"], 10);
    EXPECT_EQ(plan["standard_errors"].size(), 30U);
    std::size_t count = 0;
    for (const Json& run : plan["runs"]) {
        count += run["count"].get<std::size_t>();
        EXPECT_NEAR(run["level_g"].get<double>(), run["table_g"].get<double>() * 0.6667, 1e-9);
        EXPECT_EQ(run["position"][1], 0.0);
    }
    EXPECT_EQ(count, 20U);
    EXPECT_GT(plan["duration_s"], 2000.0);
    EXPECT_NE(content("sphere.svg").find("<svg"), std::string::npos);
    // AND judged from its file it is the same plan
    ASSERT_EQ(vibrig("plan --evaluate plan.json --levels 0,2,4,4.667,6 --json"), 0) << error;
    EXPECT_NEAR(json()["d_efficiency"], plan["d_efficiency"].get<double>(), 1e-9);
    EXPECT_NEAR(json()["duration_s"], plan["duration_s"].get<double>(), 1e-6);
    EXPECT_EQ(json()["runs"], plan["runs"]);
    // AND so it is for vibrigd
    const auto runs = [&](double transmission) {
        return vibrig::plan::read_plan_file((folder_ / "plan.json").string(),
                                            [=](auto) { return std::optional(transmission); })
            .runs;
    };
    EXPECT_EQ(runs(0.6667).size(), plan["runs"].size());
    EXPECT_THROW(static_cast<void>(runs(0.9)), vibrig::plan::PlanFileError)
        << "another transmission than the file's";
}

TEST_F(PlanCommand, JudgesPositionLists) {
    // GIVEN the 14 positions of Tang et al. 2009, table 1
    write("table1.csv", kTable1);
    // THEN at 6 and 4.667 g: rank 10, and against the free choice 0.581 with y up
    ASSERT_EQ(vibrig("plan --positions table1.csv --levels 6,4.667 --json"), 0) << error;
    EXPECT_EQ(json()["rank"], 10);
    EXPECT_NEAR(json()["vertical_axes"][1]["d_efficiency"], 0.581, 5e-4);
    EXPECT_EQ(json()["vertical_axes"][0]["rank"], 6);
    EXPECT_EQ(json()["vertical_axes"][2]["rank"], 9);
    EXPECT_NEAR(json()["standard_errors"]["D_Fx"], 0.006, 1e-4);
    // AND at one level it is refused by name, with a remedy
    EXPECT_EQ(vibrig("plan --positions table1.csv --levels 6 --json"), 1);
    EXPECT_EQ(json()["rank"], 9);
    EXPECT_EQ(json()["d_efficiency"], 0.0);
    EXPECT_EQ(json()["undetermined"], (Json{"D0", "D11", "D22", "D33"}));
    EXPECT_TRUE(json()["standard_errors"]["D_Fx"].is_null());
    EXPECT_NE(error.find("cheapest remedy"), std::string::npos) << error;
    // AND so is z up
    write("z.toml", "platform.up = \"+z\"\n");
    EXPECT_EQ(vibrig("plan --positions table1.csv --levels 6,4.667 --config z.toml"), 1);
    EXPECT_NE(error.find("does not determine D12 at all (D_IOx"), std::string::npos) << error;
}

TEST_F(PlanCommand, AListThatIsJudgedIsPutInTheOrderThatIsAskedFor) {
    write("table1.csv", kTable1);
    const std::string judged = "plan --positions table1.csv --levels 6,4.667 --json";
    ASSERT_EQ(vibrig(judged), 0) << error;
    EXPECT_GT(json()["order_inflation"]["step"], 10);
    ASSERT_EQ(json()["warnings"].size(), 1U);
    EXPECT_NE(json()["warnings"][0].get<std::string>().find("--order balanced"), std::string::npos);
    ASSERT_EQ(vibrig(judged + " --order balanced"), 0) << error;
    EXPECT_EQ(json()["run_count"], 28);
    EXPECT_LT(json()["order_inflation"]["step"], 1.5);
    EXPECT_EQ(json()["warnings"], Json::array());
}

TEST_F(PlanCommand, NumbersHaveToBeFiniteAndWithinReason) {
    for (const char* option :
         {"--forbidden-within nan", "--noise-per-g nan", "--noise-per-g 1e300", "--dwell nan",
          "--settle inf", "--slew nan", "--ramp nan", "--grid nan", "--levels 0,nan",
          "--outer nan,60", "--targets nan,0,0", "--dwell -1"}) {
        EXPECT_EQ(vibrig(std::string("plan ") + option), 2) << option;
        EXPECT_NE(error.find("expected a finite number"), std::string::npos) << error;
        EXPECT_NE(error.find(std::string(option).substr(0, std::string(option).find(' '))),
                  std::string::npos)
            << error;
    }
}

TEST_F(PlanCommand, ARecordingIsNoListOfPositions) {
    write("rec.csv",
          "time_s,run,position,alpha_deg,beta_deg,gamma_deg,ax_g,ay_g,az_g\n0,1,1,0,0,0,0,1,0\n");
    EXPECT_EQ(vibrig("plan --positions rec.csv"), 2);
    EXPECT_NE(error.find("rec.csv: found a recording (columns time_s and run), expected"),
              std::string::npos)
        << error;
}

TEST_F(PlanCommand, KeepsLimitsCostsAndTargets) {
    ASSERT_EQ(vibrig("plan --runs 14 --outer -60,60 --azimuth -100,100 --levels 0,6 --json"), 0)
        << error;
    const Json limited = json();
    for (const Json& run : limited["runs"]) {
        EXPECT_LE(std::abs(run["position"][0].get<double>()), 60.0);
        EXPECT_LE(std::abs(run["position"][2].get<double>()), 100.0);
    }
    // Noise that grows with the level moves effort to rest
    ASSERT_EQ(vibrig("plan --runs 28 --levels 0,6 --noise-per-g 1 --json"), 0) << error;
    EXPECT_LT(json()["optimal_shares"][0]["share"], 0.5);
    EXPECT_GT(json()["optimal_shares"][0]["share"], 0.1432);
    // Targets, reached
    ASSERT_EQ(vibrig("plan --levels 0,6 --targets 0.008,0.004,0.0006 --time-costs --json"), 0)
        << error;
    const Json reached = json();
    for (const auto& [name, sigma] : reached["standard_errors"].items()) {
        const double target = name[2] == 'F' ? 0.008 : name.size() == 4 ? 0.004 : 0.0006;
        EXPECT_LE(sigma.get<double>(), target * 1.001) << name;
    }
    EXPECT_LE(json()["run_count"], 20);
    EXPECT_EQ(vibrig("plan --levels 0,6 --targets 0.0001,0,0 --runs 12"), 1) << "out of reach";
    EXPECT_EQ(vibrig("plan --levels 0,60 --runs 12"), 1) << "beyond the shaker's limits";
    // Those of a rig are not asked for: what would go is said.
    write("rig.toml", "[vibration]\ntransmission = 0.5\n");
    expect_refusal("plan --levels 0,6 --config rig.toml", "expected at most 5.4");
    EXPECT_EQ(vibrig("plan --levels 0,5.4 --config rig.toml"), 0) << error;
    // A target of 0 asks for nothing, but the plan determines everything all the same
    ASSERT_EQ(vibrig("plan --levels 0,6 --targets 0.0025,0,0 --json"), 0) << error;
    EXPECT_EQ(json()["rank"], 10);
    EXPECT_LE(json()["standard_errors"]["D_Fx"].get<double>(), 0.0025);
    EXPECT_LE(json()["run_count"], 20);
    // What is met with fewer runs is not given up for the sake of others
    ASSERT_EQ(vibrig("plan --runs 10 --levels 0,6 -o ten.json"), 0) << error;
    for (const char* targets : {"0.0029,0.003,0.0004", "0.003,0.003,0.0004"})
        EXPECT_EQ(vibrig(std::string("plan --done ten.json --levels 0,6 --targets ") + targets), 0)
            << error;
    // Both orders
    for (const char* order : {"travel", "random"}) {
        ASSERT_EQ(vibrig(std::string("plan --runs 20 --json --order ") + order), 0) << error;
        EXPECT_EQ(json()["run_count"], 20);
    }
    // Runs done already are kept: the rest completes them
    ASSERT_EQ(vibrig("plan --runs 12 --levels 0,6 -o done.json"), 0) << error;
    ASSERT_EQ(vibrig("plan --runs 4 --levels 0,6 --done done.json -o new.json --json"), 0) << error;
    EXPECT_EQ(json()["run_count"], 4);
    EXPECT_EQ(json()["rank"], 10);
    // They tell what one plan of all of them, in their order, does.
    const Json rest = json();
    Json both = Json::parse(content("done.json"));
    const Json added = Json::parse(content("new.json"));
    both["runs"].insert(both["runs"].end(), added["runs"].begin(), added["runs"].end());
    write("both.json", both.dump());
    ASSERT_EQ(vibrig("plan --evaluate both.json --levels 0,6 --json"), 0) << error;
    const Json whole = json();
    for (const char* what : {"standard_errors", "combined_uncertainty"}) {
        for (const auto& [name, u] : whole[what].items())
            EXPECT_NEAR(rest[what][name].get<double>(), u.get<double>(), 1e-9 * u.get<double>())
                << what << ' ' << name;
    }
}

TEST_F(PlanCommand, WhatIsHeldOutTellsOfNoCoefficient) {
    // GIVEN a plan, one with some of its runs held out, and one without those
    ASSERT_EQ(vibrig("plan --runs 20 --levels 0,6 -o plan.json"), 0) << error;
    Json held = Json::parse(content("plan.json")), without = held;
    auto& runs = without["runs"];
    const std::size_t kept = runs.size() - 3;
    for (std::size_t i = kept; i < held["runs"].size(); ++i) held["runs"][i]["role"] = "verify";
    runs.erase(runs.begin() + static_cast<std::ptrdiff_t>(kept), runs.end());
    write("held.json", held.dump());
    write("without.json", without.dump());
    // WHEN they are judged THEN the last two tell the same, and less than the first
    const auto judged = [&](const std::string& more) {
        EXPECT_NE(vibrig("plan --levels 0,6 --json " + more), 2) << error;
        return json();
    };
    const Json all = judged("--evaluate plan.json"), one = judged("--evaluate held.json"),
               other = judged("--evaluate without.json");
    EXPECT_EQ(one["rank"], other["rank"]);
    for (const char* what : {"standard_errors", "combined_uncertainty"}) {
        for (const auto& [name, sigma] : other[what].items())
            EXPECT_NEAR(one[what][name].get<double>(), sigma.get<double>(),
                        1e-9 * sigma.get<double>())
                << what << ' ' << name;
    }
    EXPECT_GT(one["standard_errors"]["D_Fx"], all["standard_errors"]["D_Fx"]);
    // AND as dwells that are done
    EXPECT_EQ(judged("--runs 4 --done held.json")["standard_errors"],
              judged("--runs 4 --done without.json")["standard_errors"]);
}

TEST_F(PlanCommand, AModelWithoutTermsIsRefused) {
    for (const char* other : {"", " --turntable", " --evaluate plan.csv"}) {
        EXPECT_EQ(vibrig(std::string("plan --without D0,D1,D2,D3,D11,D22,D33,D12,D13,D23") + other),
                  2)
            << other;
        EXPECT_NE(error.find("--without: found all ten terms, expected one left at least"),
                  std::string::npos)
            << error;
    }
}

TEST_F(PlanCommand, RefusesBadInputWithPlaceAndValue) {
    write("nan.csv", "alpha_deg,beta_deg,gamma_deg\n0,0,0\n0,nan,0\n");
    write("lock.csv", "alpha_deg,beta_deg,gamma_deg\n0,85,0\n");
    write("short.csv", "alpha_deg,beta_deg\n0,0\n");
    write("empty.csv", "");
    write("comma.csv", "alpha_deg,beta_deg,gamma_deg,level_g,count\n0,0,0,4,667,1\n");
    write("bad.json", "{\"runs\":[{\"position\":[0,0],\"level_g\":6}]}");
    write("cut.json", "{\"runs\":[{\"posi");
    write("levels.json", "{\"runs\":[{\"position\":[0,0,0],\"level_g\":6,\"table_g\":6}]}");
    write("random.json",
          R"({"runs":[{"position":[0,0,0],"level_g":6,"table_g":9},
                      {"position":[0,45,0],"profile":"road","level_db":-3}]})");
    write("random.csv", "alpha_deg,beta_deg,gamma_deg,level_g,profile,level_db\n0,0,0,0,road,0\n");
    const std::string run = R"({"position":[0,0,0],"table_g":9)";
    write("key.json", R"({"runs":[)" + run + R"(,"freqency_hz":30}]})");
    write("top.json", R"({"runs":[)" + run + R"(}],"frequency":30})");
    write("many.json", R"({"runs":[)" + run + R"(,"count":1000000000}]})");
    write("dwell.json", R"({"dwell_s":0,"runs":[)" + run + "}]}");
    write("hz.json", R"({"frequency_hz":30,"runs":[)" + run + "}]}");
    write("pads.json", R"({"transmission":0.9,"runs":[)" + run + "}]}");
    write("limit.toml", "shaker.limits.acceleration_g = 5\n");
    write("rig.toml", "vibration.transmission = 0.6667\n");
    struct Case {
        const char* arguments;
        const char* words;
    };
    for (const Case& c :
         {Case{"--runs 9", "--runs: found 9, expected 10 at least for 10 coefficients"},
          Case{"--levels 0,-1", "--levels: found -1"},
          Case{"--levels 0,nan", "--levels: found"},
          Case{"--positions nan.csv", "nan.csv:3: column beta_deg: found 'nan'"},
          Case{"--positions lock.csv", "lock.csv:2"},
          Case{"--positions short.csv", "no column gamma_deg"},
          Case{"--positions empty.csv", "empty.csv"},
          Case{"--positions none.csv", "none.csv"},
          Case{"--evaluate comma.csv", "comma.csv:2: found 6 fields, expected 5"},
          Case{"--evaluate bad.json", "runs[0].position"},
          Case{"--evaluate key.json",
               "key.json: runs[0].freqency_hz: found an unknown key, "
               "expected a known one, perhaps frequency_hz"},
          Case{"--evaluate top.json", "top.json: plan.frequency: found an unknown key, expected"},
          Case{"--evaluate many.json", "expected a whole number from 1 to 100000"},
          Case{"--evaluate dwell.json", "plan.dwell_s: found 0.0, expected more than 0 s"},
          Case{"--evaluate hz.json",
               "plan.frequency_hz: found 30.0 Hz, and runs without one of "
               "their own, expected the configuration's "
               "vibration.frequency_hz, 15.0 Hz"},
          Case{"--evaluate pads.json --config rig.toml",
               "plan.transmission: found 0.9, expected the configuration's"},
          Case{"--evaluate cut.json",
               "cut.json: not JSON, expected a plan; line 1, column 16: the text ends\n"},
          Case{"--evaluate levels.json", "transmission 0.6667"},
          Case{"--evaluate random.json", "runs[1].profile: found road, expected a sine"},
          Case{"--runs 12 --levels 0,6 --done random.csv", "random.csv:2"},
          Case{"--levels 0,6 --config limit.toml", "shaker.limits.acceleration_g"},
          Case{"--inner 30,20", "--inner: found 30"},
          Case{"--outer 1,2 --azimuth 1,2", "leave no position"},
          Case{"--grid 30 --positions lock.csv", "--grid"},
          Case{"--forbidden-within 5", "--forbidden"},
          Case{"--block 4", "--block"},
          Case{"--block 4 --order balanced", "found --block with --order balanced"},
          Case{"--without D99", "--without: found \"D99\""}}) {
        EXPECT_EQ(vibrig(std::string("plan ") + c.arguments), 2) << c.arguments << out << error;
        EXPECT_NE(error.find(c.words), std::string::npos) << c.arguments << ": " << error;
    }
}

TEST_F(PlanCommand, ReproducesThePublishedTables) {
    EXPECT_EQ(vibrig("reproduce dplan --json"), 0) << out << error;
    std::size_t compared = 0;
    const Json result = json();
    for (const Json& row : result["reproductions"][0]["rows"]) {
        if (row["agrees"].is_null()) continue;
        EXPECT_TRUE(row["agrees"].get<bool>()) << row.dump();
        ++compared;
    }
    EXPECT_GT(compared, 40U);
}

}  // namespace
