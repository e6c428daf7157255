#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "daemon/plan/plan_file.hpp"
#include "estimator/spectrum/sampling.hpp"
#include "tests/unit/daemon/tool/design/survey_command.hpp"

namespace {

using vibrig::plan::testing::as_the_table;
using vibrig::plan::testing::SurveyCommand;
using vibrig::plan::testing::SurveyJson;
namespace spectrum = vibrig::estimator::spectrum;

TEST_F(SurveyCommand, PlansTheSurveyOf63Dwells) {
    // WHEN a survey is planned for the hard mount
    ASSERT_EQ(vibrig("plan --frequencies 15,25,35 --highest 125 --mount hard --json -o plan.json"),
              0)
        << error;
    const SurveyJson plan = json();
    // THEN each of seven frequencies has its dwells, at 6 g, off what 40 samples/s forbid
    std::map<long, int> dwells;  // of tenths of a hertz
    for (const auto& run : plan["runs"]) {
        const int count = run["count"].get<int>();
        if (!run.contains("frequency_hz")) {
            EXPECT_EQ(run["level_g"], 0.0);
            dwells[0] += count;
            continue;
        }
        EXPECT_EQ(run["level_g"], 6.0);
        EXPECT_EQ(run["table_g"], 6.0);
        EXPECT_FALSE(spectrum::forbidden(run["frequency_hz"], 40, 10, spectrum::kHarmonicsPlanned));
        dwells[std::lround(10 * run["frequency_hz"].get<double>())] += count;
    }
    EXPECT_EQ(plan["run_count"], 63);
    ASSERT_EQ(dwells.size(), 8U);
    EXPECT_EQ(dwells[0], 7);
    EXPECT_EQ(dwells[151], 14);
    EXPECT_EQ(dwells[1251], 7);
    EXPECT_EQ(plan["rank"], 10);
    EXPECT_EQ(plan["survey"]["mount"], "hard");
    EXPECT_EQ(plan["survey"]["frequencies"].size(), 7U);
    EXPECT_NEAR(plan["survey"]["highest_hz"], 125.1, 1e-9);
    // 2.8 h with gaps
    EXPECT_NEAR(plan["duration_s"].get<double>() / 3600, 2.1, 0.8);
    // AND vibrigd's reader takes the file
    const auto runs = vibrig::plan::read_plan_file(path("plan.json"), as_the_table).runs;
    ASSERT_EQ(runs.size(), plan["runs"].size());
    for (std::size_t i = 0; i < runs.size(); ++i)
        EXPECT_EQ(runs[i].frequency_hz, plan["runs"][i].value("frequency_hz", 0.0)) << i;
    // AND judged from its file it is the same plan
    write("hard.toml", "spectrum.mount = \"hard\"\n");
    ASSERT_EQ(vibrig("plan --evaluate plan.json --config hard.toml --json"), 0) << error;
    EXPECT_EQ(json()["runs"], plan["runs"]);
    EXPECT_NEAR(json()["duration_s"], plan["duration_s"].get<double>(), 1e-6);
    // AND without a configuration, too: it says itself what it stands on
    ASSERT_EQ(vibrig("plan --evaluate plan.json --json"), 0) << error;
    EXPECT_EQ(json()["runs"], plan["runs"]);
    EXPECT_EQ(json()["transmission"], 1);
    // but not against one that says otherwise
    write("pads.toml", "vibration.transmission = 0.6667\n");
    EXPECT_EQ(vibrig("plan --evaluate plan.json --config pads.toml"), 2);
    EXPECT_NE(error.find("platform over table to be the transmission"), std::string::npos) << error;
}

TEST_F(SurveyCommand, OnOtherIsolatorsIsJudgedOnThem) {
    write("soft.toml", "vibration.transmission = 0.5\n");
    ASSERT_EQ(vibrig("plan --frequencies 15,25 --config soft.toml --json -o plan.json"), 0)
        << error;
    const SurveyJson plan = json();
    ASSERT_EQ(vibrig("plan --evaluate plan.json --json"), 0) << error;
    EXPECT_EQ(json()["runs"], plan["runs"]);
    EXPECT_NEAR(json()["transmission"].get<double>(), 0.5, 1e-4);
}

TEST_F(SurveyCommand, SaysWhatIsMovedAndWhatTheLimitsLeave) {
    ASSERT_EQ(vibrig("plan --frequencies 15,60 --mount isolated --order list"), 0) << error;
    EXPECT_NE(out.find("60 Hz is forbidden at 40 samples/s: the nearest free frequency, 60.2 Hz"),
              std::string::npos)
        << out;
    EXPECT_NE(out.find("frequencies above 30 Hz want the hard mount"), std::string::npos) << out;
    EXPECT_EQ(vibrig("plan --frequencies 10.3,60"), 2);
    EXPECT_NE(error.find("found 10.3 Hz, expected 12.98"), std::string::npos) << error;
    // What it wrote it takes back, whatever frequency comes first: its runs have their own.
    ASSERT_EQ(vibrig("plan --frequencies 20,25 --mount isolated --order list -o own.json"), 0)
        << error;
    EXPECT_EQ(vibrig("plan --evaluate own.json"), 0) << error;
}

/// At 60 Hz behind isolators little shakes, and 2 arcsec in step with it are a large drift.
TEST_F(SurveyCommand, TellsWhatMotionInStepMayDriftAtEachFrequency) {
    const auto coning = [&](const std::string& mount) {
        EXPECT_EQ(vibrig("plan --frequencies 15.1,65.1 --json --order list --mount " + mount), 0)
            << error;
        std::vector<double> list;
        const SurveyJson survey = json()["survey"];
        EXPECT_EQ(survey["coning_arcsec"], 2);
        for (const auto& line : survey["frequencies"])
            list.push_back(line["coning_bound_deg_h_per_g2"]);
        return list;
    };
    const auto hard = coning("hard"), isolated = coning("isolated");
    EXPECT_NEAR(hard[0], 2 * 3.14159265 * 15.1 * 4 / 206264.80625 / 36, 1e-9);
    EXPECT_NEAR(hard[1] / hard[0], 65.1 / 15.1, 1e-6);
    EXPECT_NEAR(isolated[1], 0.015, 0.001);
    ASSERT_EQ(vibrig("plan --frequencies 15.1,65.1 --mount hard --order list"), 0);
    EXPECT_NE(out.find("dwells, coning 5.1e-05"), std::string::npos) << out;
    EXPECT_NE(out.find("turns by 2 arcsec in step"), std::string::npos) << out;
    EXPECT_NE(out.find("a flat verdict "), std::string::npos) << out;
    // Nothing contradicts a single frequency.
    ASSERT_EQ(vibrig("plan --frequencies 15.1 --mount hard --order list"), 0) << error;
    EXPECT_NE(out.find("a flat verdict cannot come of these"), std::string::npos) << out;
}

TEST_F(SurveyCommand, APlanForAProfileReachesItsHighestFrequencyOrSaysSo) {
    write("top.toml", "spectrum.highest_hz = 125\nspectrum.mount = \"hard\"\n");
    ASSERT_EQ(vibrig("plan --profile truck --attitude 45,0,90 --config top.toml --order list "
                     "--json"),
              0)
        << error;
    const SurveyJson plan = json();
    EXPECT_EQ(plan["survey"]["profile"], "truck");
    EXPECT_GT(plan["survey"]["predicted_u_deg_h"], 0.0);
    EXPECT_NEAR(plan["survey"]["frequencies"].back()["hz"], 125.1, 1e-9);
    EXPECT_NE(plan["warnings"].dump().find("reaches to 500 Hz, the plan to 125 Hz"),
              std::string::npos)
        << plan["warnings"];
    EXPECT_EQ(vibrig("plan --profile lorry"), 2);
    EXPECT_NE(error.find("found 'lorry', expected a JSON file or one of"), std::string::npos)
        << error;
}

TEST_F(SurveyCommand, BadInputIsNamed) {
    const std::map<std::string, std::string> refusals{
        {"plan --frequencies 15,35 --highest 20", "found 20 Hz, expected 35 Hz at least"},
        {"plan --frequencies 15,35 --levels 2,6", "expected one level with --frequencies"},
        {"plan --frequencies 15,35 --runs 25 --mount hard", "--runs: found 25"},
        {"plan --frequencies 15,15.1 --mount hard", "2 % above"},
        {"plan --mount hard", "--frequencies, --highest, --profile, --sweeps or --about with it"},
        {"plan --frequencies 15,nan", "expected a finite number"},
        {"plan --frequencies 15,35 --attitude 1,2,3", "--attitude"},
        {"plan --frequencies 15,35 --outer -1,1", "--outer"},
        {"plan --frequencies 15,35 --forbidden p.csv", "--forbidden"},
        {"plan --frequencies 15,35 --evaluate plan.json", "--evaluate"}};
    for (const auto& [arguments, words] : refusals) {
        EXPECT_EQ(vibrig(arguments), 2) << arguments;
        EXPECT_NE(error.find(words), std::string::npos) << arguments << ": " << error;
    }
}

/// First order, 100 Hz: of 100 Hz they see half. --check would refuse more; a plan has none of it.
TEST_F(SurveyCommand, APlanAvoidsWhatTheAccelerometersDoNotSee) {
    write("rig.toml", "[accelerometer]\nbandwidth_hz = 100.0\n[spectrum]\nmount = \"hard\"\n");
    ASSERT_EQ(vibrig("plan --config rig.toml --frequencies 15,25,35,180 --highest 200 --json"), 0)
        << error;
    double highest = 0;
    std::set<double> all;
    const SurveyJson plan = json();
    for (const auto& run : plan.at("runs")) {
        const double hz = run.value("frequency_hz", 0.0);
        highest = std::max(highest, hz);
        if (hz > 0) all.insert(hz);
    }
    EXPECT_LE(highest, 100);
    EXPECT_GT(highest, 90);
    EXPECT_GE(all.size(), 5U);
    const std::string warnings = plan.at("warnings").dump();
    EXPECT_NE(warnings.find("180 Hz is left out: the accelerometers see 0.2358"), std::string::npos)
        << warnings;
    EXPECT_NE(warnings.find("and not to 200 Hz: beyond it the accelerometers see less than half"),
              std::string::npos)
        << warnings;
    EXPECT_EQ(vibrig("plan --config rig.toml --frequencies 150,180 --json"), 2);
    EXPECT_NE(error.find("--frequencies: found none of which the accelerometers see half"),
              std::string::npos)
        << error;
}

TEST_F(SurveyCommand, APlanFileWithWhatIsNotRunIsRefusedByItsPlace) {
    const std::string at = R"({"runs":[{"position":[0,0,0],"level_g":6)";
    const std::string bare = R"({"runs":[{"position":[0,0,0])";
    EXPECT_TRUE(refuses(at + R"(,"frequency_hz":"x"}]})", "runs[0].frequency_hz: found \"x\""))
        << error;
    EXPECT_TRUE(refuses(at + R"(,"frequency_hz":-3}]})", "runs[0].frequency_hz: found -3"))
        << error;
    EXPECT_TRUE(refuses(at + R"(,"profile":"truck"}]})", "runs[0].level_g: found 6 beside a"))
        << error;
    EXPECT_TRUE(refuses(bare + R"(,"profile":"truck"}]})", "runs[0].profile: found truck"))
        << error;
    EXPECT_TRUE(refuses(bare + R"(,"profile":0}]})", "runs[0].profile: found 0")) << error;
    EXPECT_TRUE(refuses(at + R"(,"level_db":-3}]})", "runs[0].level_db: found -3")) << error;
    EXPECT_TRUE(refuses(at + R"(,"sweep":{"s":99}}]})", "runs[0].sweep.from_hz: found nothing"))
        << error;
    EXPECT_TRUE(refuses(at + R"(,"sweep":20}]})", "runs[0].sweep: found 20, expected an object"))
        << error;
    const auto sweep = [&](const char* more, const char* from, const char* to, const char* s) {
        return at + more + R"(,"sweep":{"from_hz":)" + from + R"(,"to_hz":)" + to + R"(,"s":)" + s +
               "}}]}";
    };
    EXPECT_TRUE(refuses(sweep("", "20", "21", "99"), "found 20.0 to 21.0 Hz, expected ends that"))
        << error;
    EXPECT_TRUE(refuses(sweep("", "-20", "120", "99"), "runs[0].sweep: found -20.0 Hz")) << error;
    EXPECT_TRUE(refuses(sweep("", "20", "120", "9"), "found 9.0 s, expected 10 to 86400 s"))
        << error;
    EXPECT_TRUE(refuses(sweep(R"(,"frequency_hz":15)", "20", "120", "99"),
                        "found 15.0 Hz beside a sweep, expected one of them"))
        << error;
    EXPECT_TRUE(refuses(bare + R"(,"profile":"truck","sweep":{"s":9}}]})",
                        "runs[0].sweep: found {\"s\":9} beside a profile"))
        << error;
    EXPECT_TRUE(refuses(at + R"(,"role":"test"}]})", "\"identify\" or \"verify\"")) << error;
    write("plan.csv",
          "alpha_deg,beta_deg,gamma_deg,level_g,frequency_hz\n0,0,0,6,35.1\n0,0,45,0,0\n");
    const auto runs = vibrig::plan::read_plan_file(path("plan.csv"), as_the_table).runs;
    ASSERT_EQ(runs.size(), 2U);
    EXPECT_EQ(runs[0].frequency_hz, 35.1);
    EXPECT_EQ(runs[1].frequency_hz, 0);
}

TEST_F(SurveyCommand, ACsvPlanHasProfilesLevelsAndRoles) {
    const auto read = [&](const std::string& text) {
        write("plan.csv", text);
        return vibrig::plan::read_plan_file(path("plan.csv"),
                                            [](auto) { return std::optional(0.5); })
            .runs;
    };
    // Columns in any order, others ignored; a profile by name, with spaces about it, or by number.
    const auto runs = read(
        "role,profile,level_db,alpha_deg,beta_deg,gamma_deg,table_g,frequency_hz,count,who\n"
        ",,,0,0,0,6,15,2,anna\n"
        "identify,broad,-1.5,10,20,30,,,1,\n"
        "verify, 4 ,,10,20,30,0,0,3,\n"
        "verify,0,0,0,0,0,0,0,1,\n");
    ASSERT_EQ(runs.size(), 4U);
    EXPECT_EQ(runs[0].profile, "");
    EXPECT_EQ(runs[0].level_g, 3);
    EXPECT_EQ(runs[0].count, 2U);
    EXPECT_EQ(runs[1].profile, "broad");
    EXPECT_EQ(runs[1].level_db, -1.5);
    EXPECT_EQ(runs[1].table_g, 0);
    EXPECT_FALSE(runs[1].verify);
    EXPECT_EQ(runs[2].profile, "4");
    EXPECT_EQ(runs[2].level_db, 0);
    EXPECT_TRUE(runs[2].verify);
    EXPECT_EQ(runs[3].profile, "");
    EXPECT_TRUE(runs[3].verify);
    // Sweeps, up and down.
    const auto swept = read(
        "alpha_deg,beta_deg,gamma_deg,table_g,frequency_hz,sweep_from_hz,sweep_to_hz,sweep_s\n"
        "0,0,0,6,15,,,\n"
        "0,0,45,6,,20,120,300\n"
        "0,0,45,6,0,120,20,300\n");
    ASSERT_EQ(swept.size(), 3U);
    EXPECT_EQ(swept[0].sweep_to_hz, 0);
    EXPECT_EQ(swept[1].sweep_from_hz, 20);
    EXPECT_EQ(swept[1].sweep_to_hz, 120);
    EXPECT_EQ(swept[1].sweep_s, 300);
    EXPECT_EQ(swept[1].frequency_hz, 0);
    EXPECT_EQ(swept[1].level_g, 3);
    EXPECT_EQ(swept[2].sweep_from_hz, 120);
    // The same as JSON says it.
    write(
        "plan.json",
        R"({"runs":[{"position":[10,20,30],"profile":"broad","level_db":-1.5,"role":"verify"}]})");
    const auto json = vibrig::plan::read_plan_file(path("plan.json"), [](auto) {
                          return std::optional(0.5);
                      }).runs;
    EXPECT_EQ(json[0].profile, runs[1].profile);
    EXPECT_EQ(json[0].level_db, runs[1].level_db);
}

TEST_F(SurveyCommand, WhatIsWrongInACsvPlanIsReportedWithLineAndColumn) {
    const std::string head =
        "alpha_deg,beta_deg,gamma_deg,table_g,frequency_hz,profile,level_db,"
        "role,sweep_from_hz,sweep_to_hz,sweep_s\n0,0,0,6,15,,,,,,\n";
    const auto refusal = [&](const std::string& row) -> std::string {
        write("plan.csv", head + row + "\n");
        try {
            static_cast<void>(vibrig::plan::read_plan_file(path("plan.csv"), as_the_table));
        } catch (const vibrig::plan::PlanFileError& refused) {
            return std::string(refused.what()).substr(path("plan.csv").size());
        }
        return "";
    };
    EXPECT_EQ(refusal("0,0,0,6,15,broad,0,,,,"),
              ":3: column frequency_hz: found 15.0 beside a profile, expected level_db alone: the "
              "profile has frequencies and g");
    EXPECT_EQ(
        refusal("0,0,0,6,,broad,0,,,,"),
        ":3: column table_g: found 6.0 beside a profile, expected level_db alone: the profile "
        "has frequencies and g");
    EXPECT_EQ(refusal("0,0,0,6,15,,-3,,,,"),
              ":3: column level_db: found -3.0, expected a profile beside it");
    EXPECT_EQ(refusal("0,0,0,,,broad,61,,,,"),
              ":3: column level_db: found 61.0, expected -60 to 60 dB");
    EXPECT_EQ(refusal("0,0,0,,,broad,loud,,,,"),
              ":3: column level_db: found 'loud', expected a number");
    EXPECT_EQ(refusal("0,0,0,,15,,,,,,"), ":3: column table_g: found nothing, expected a number");
    EXPECT_EQ(refusal("0,0,0,6,,,,,,,"),
              ":3: column frequency_hz: found nothing, expected a number");
    EXPECT_EQ(refusal("0,0,0,6,15,,,test,,,"),
              ":3: column role: found 'test', expected identify or verify");
    EXPECT_EQ(refusal("0,0,0,6,15,,,,20,120,100"),
              ":3: column sweep_from_hz: found 15.0 Hz beside a sweep, expected one of them");
    EXPECT_EQ(refusal("0,0,0,6,,,,,20,,100"),
              ":3: column sweep_from_hz: found 0.0 Hz, expected 0.1 to 20000 Hz");
    EXPECT_EQ(refusal("0,0,,,,broad,0,,,,"),
              ":3: column gamma_deg: found nothing, expected a number");
    EXPECT_EQ(refusal("0,0,0,,,broad,0,verify,,,"), "");
    const auto column = [&](const std::string& name) -> std::string {
        write("plan.csv", "alpha_deg,beta_deg,gamma_deg,table_g," + name + "\n0,0,0,6,2\n");
        try {
            static_cast<void>(vibrig::plan::read_plan_file(path("plan.csv"), as_the_table));
        } catch (const vibrig::plan::PlanFileError& refused) {
            return std::string(refused.what()).substr(path("plan.csv").size());
        }
        return "";
    };
    EXPECT_EQ(
        column("counts"),
        ":1: column counts: found an unknown key, expected a known one, perhaps count; known "
        "are alpha_deg, beta_deg, gamma_deg, count, level_g, table_g, frequency_hz, level_db, "
        "sweep_from_hz, sweep_to_hz, sweep_s, profile, role");
    EXPECT_EQ(
        column("dwell_s"),
        ":1: column dwell_s: found one of a run, expected none: it is campaign.dwell_s of the "
        "configuration for all");
    EXPECT_EQ(
        column("freq_hz"),
        ":1: column freq_hz: found an unknown key, expected a known one, perhaps frequency_hz");
    // Remarks beside what they resemble.
    EXPECT_EQ(column("who"), "");
    EXPECT_EQ(column("alpha_rad"), "");
    EXPECT_EQ(column("frequency_hz,freq_hz"), "");
    write("plan.csv", head + "0,0,0,,,broad,0,,,,\n");
    try {
        vibrig::plan::refuse_random(
            vibrig::plan::read_plan_file(path("plan.csv"), as_the_table).runs);
        ADD_FAILURE() << "taken";
    } catch (const vibrig::plan::PlanFileError& refused) {
        EXPECT_NE(std::string(refused.what()).find("plan.csv:3: column profile: found broad"),
                  std::string::npos)
            << refused.what();
    }
}

}  // namespace
