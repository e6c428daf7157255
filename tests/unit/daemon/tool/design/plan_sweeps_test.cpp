#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <string>
#include <vector>

#include "daemon/plan/plan_file.hpp"
#include "tests/unit/daemon/tool/design/survey_command.hpp"

namespace vibrig::plan::testing {
namespace {

/// A rig whose controller sweeps, 200 samples a second.
constexpr const char* kRig =
    "can.sample_rate_hz = 200\n"
    "commission.simulated = true\n"
    "spectrum.mode = \"mixed\"\n"
    "shaker.registers.mode.address = 8\n"
    "shaker.registers.sweep_from = { address = 11, type = \"u32\", scale = 0.001 }\n"
    "shaker.registers.sweep_to = { address = 13, type = \"u32\", scale = 0.001 }\n"
    "shaker.registers.sweep_rate = { address = 15, scale = 0.01 }\n"
    "shaker.registers.actual_frequency = { address = 10, table = \"input\", type = \"u32\", "
    "scale = 0.001 }\n";

class SweepsCommand : public SurveyCommand {
  protected:
    SweepsCommand() {
        write("hard.toml", std::string(kRig) + "spectrum.mount = \"hard\"\n");
        write("pads.toml", kRig);
    }
    /// `vibrigd --check` of a configuration with this plan; its complaint, if any.
    std::string check(const std::string& rig, const std::string& plan) {
        write("check.toml", "campaign.plan = \"" + path(plan) + "\"\n" + content(rig));
        const std::string command = "cd '" + folder_.string() +
                                    "' && '" VIBRIGD "' --config check.toml --check >out 2>error";
        const int status = std::system(command.c_str());
        return WIFEXITED(status) && WEXITSTATUS(status) == 0 ? "" : content("error") + "?";
    }
    std::vector<SurveyJson> sweeps() const {
        std::vector<SurveyJson> swept;
        const SurveyJson plan = json();
        for (const auto& run : plan.at("runs")) {
            if (run.contains("sweep")) swept.push_back(run);
        }
        return swept;
    }
    std::string warnings() const { return json().at("warnings").dump(); }
};

/// Platform over table of pads with 2/3 at 15 Hz and damping 0.2, written a second time.
double pads(double hz) {
    const double r = hz / 9.18, d = 2 * 0.2 * r;
    return std::sqrt((1 + d * d) / ((1 - r * r) * (1 - r * r) + d * d));
}

TEST_F(SweepsCommand, ThreePositionsUpAndDownComeFirst) {
    ASSERT_EQ(vibrig("plan --sweeps 20,120 --frequencies 15 --config hard.toml --json -o p.json"),
              0)
        << error;
    const SurveyJson plan = json();
    const auto swept = sweeps();
    ASSERT_EQ(swept.size(), 6U);
    std::set<std::string> positions;
    for (std::size_t k = 0; k < 6; ++k) {
        EXPECT_EQ(plan["runs"][k], swept[k]) << "first of all";
        const auto& sweep = swept[k]["sweep"];
        EXPECT_EQ(sweep["from_hz"], k % 2 == 0 ? 20.0 : 120.0);
        EXPECT_EQ(sweep["to_hz"], k % 2 == 0 ? 120.0 : 20.0);
        EXPECT_EQ(sweep["s"], 300.0);
        EXPECT_EQ(swept[k]["table_g"], 6.0);
        EXPECT_EQ(swept[k]["level_g"], 6.0);
        EXPECT_FALSE(swept[k].contains("frequency_hz"));
        positions.insert(swept[k]["position"].dump());
        EXPECT_EQ(swept[k]["position"], swept[k - k % 2]["position"]);
    }
    EXPECT_EQ(positions.size(), 3U);
    // The rest is the survey at one frequency: 14 positions, and rest at seven.
    EXPECT_EQ(plan["run_count"], 6 + 14 + 7);
    for (const char* product : {"xx", "yy", "zz", "xy", "xz", "yz"})
        EXPECT_GT(plan["sweeps"]["products_seen"][product], 0.2) << product;
    EXPECT_NEAR(plan["sweeps"]["up"]["usable"], 0.86, 0.02);
    // The six take half an hour and their beginnings.
    ASSERT_EQ(vibrig("plan --frequencies 15 --config hard.toml --json"), 0) << error;
    const double without = json()["duration_s"];
    EXPECT_GT(plan["duration_s"].get<double>() - without, 6 * 300);
    EXPECT_LT(plan["duration_s"].get<double>() - without, 6 * 400);
    EXPECT_EQ(json()["standard_errors"], plan["standard_errors"]) << "a sweep is no row";
}

TEST_F(SweepsCommand, VibrigdTakesThePlan) {
    ASSERT_EQ(vibrig("plan --sweeps 20,120 --sweep-s 100 --frequencies 15 --highest 60 --config "
                     "hard.toml -o hard.json"),
              0)
        << error;
    EXPECT_NE(out.find("20 to 120 Hz in 100 s"), std::string::npos) << out;
    EXPECT_NE(out.find("and 6 sweeps"), std::string::npos) << out;
    EXPECT_EQ(check("hard.toml", "hard.json"), "");
    ASSERT_EQ(vibrig("plan --sweeps 20,60 --frequencies 15 --config pads.toml -o pads.json"), 0)
        << error;
    EXPECT_EQ(check("pads.toml", "pads.json"), "");
    // Judged from its file it is the same.
    ASSERT_EQ(vibrig("plan --evaluate hard.json --config hard.toml --json"), 0) << error;
    const SurveyJson judged = json(), planned = SurveyJson::parse(content("hard.json"));
    EXPECT_EQ(judged["runs"], planned["runs"]);
    EXPECT_EQ(judged["standard_errors"], planned["standard_errors"]);
    EXPECT_NEAR(judged["duration_s"], planned["duration_s"].get<double>(), 1e-6);
}

/// The limits, written a second time, at every frequency of a fine grid.
TEST_F(SweepsCommand, TheLevelIsWhatNoFrequencyForbids) {
    const auto holds = [&](double low, double high, double platform_g, bool hard) {
        const double table_g = json()["sweeps"]["table_g"];
        double slack = 1e9;
        for (int k = 0; k <= 1000; ++k) {
            const double hz = low * std::pow(high / low, k / 1000.0), g = 9.80665 * table_g;
            const double omega = 2 * std::numbers::pi * hz, ratio = hard ? 1 : pads(hz);
            for (const double over : {table_g / 12, g / omega / 1.5, 1e3 * g / omega / omega / 12,
                                      table_g * ratio / platform_g}) {
                EXPECT_LE(over, 1 + 1e-4) << hz;
                slack = std::min(slack, 1 - over);
            }
        }
        EXPECT_LT(slack, 1e-3) << "and no less";
    };
    ASSERT_EQ(vibrig("plan --sweeps 8,40 --frequencies 15 --config hard.toml --json"), 0) << error;
    holds(8, 40, 6, true);
    EXPECT_EQ(json()["sweeps"]["table_g"], 3.091);
    EXPECT_NE(warnings().find("the shaker's limits leave 3.091 g at the table, at 8 Hz"),
              std::string::npos)
        << warnings();
    ASSERT_EQ(vibrig("plan --sweeps 14,60 --frequencies 15 --config pads.toml --json"), 0) << error;
    holds(14, 60, 6, false);
    EXPECT_NEAR(json()["sweeps"]["level_g"][0],
                json()["sweeps"]["table_g"].get<double>() * pads(60), 2e-3);
    ASSERT_EQ(vibrig("plan --sweeps 20,60 --levels 0,3 --frequencies 15 --config hard.toml --json"),
              0)
        << error;
    EXPECT_EQ(json()["sweeps"]["table_g"], 3.0);
    write("cut.toml", content("hard.toml") + "accelerometer.range_g = 5\n");
    ASSERT_EQ(vibrig("plan --sweeps 20,60 --frequencies 15 --config cut.toml --json"), 0) << error;
    EXPECT_EQ(json()["sweeps"]["table_g"], 4.0);
    EXPECT_NE(warnings().find("accelerometer.range_g leaves 4 g of 6 g"), std::string::npos)
        << warnings();
    // Measured, with a bump between the ends: that is where the platform has most.
    write("bump.toml", content("pads.toml") +
                           "spectrum.transmission = [[10, 1], [20, 0.4], [30, 0.8], [60, 0.1]]\n");
    ASSERT_EQ(vibrig("plan --sweeps 20,60 --frequencies 15 --config bump.toml --json"), 0) << error;
    EXPECT_NEAR(json()["sweeps"]["table_g"], 7.5, 1e-9);
    EXPECT_NEAR(json()["sweeps"]["level_g"][1], 6, 1e-9);
}

TEST_F(SweepsCommand, WhatIsMissingIsSaid) {
    write("no_registers.toml", "can.sample_rate_hz = 200\nspectrum.mount = \"hard\"\n");
    ASSERT_EQ(vibrig("plan --sweeps 20,60 --frequencies 15 --config no_registers.toml --json"), 0)
        << error;
    EXPECT_NE(warnings().find("has not the registers for them"), std::string::npos) << warnings();
}

TEST_F(SweepsCommand, WrongInputIsOneClearError) {
    write("hundred.toml", "spectrum.mount = \"hard\"\ncan.sample_rate_hz = 100\n");
    write("forty.toml", "spectrum.mount = \"hard\"\n");
    write("dull.toml", content("hard.toml") + "accelerometer.bandwidth_hz = 100\n");
    write("short.toml",
          content("pads.toml") + "spectrum.transmission = [[14, 0.7], [30, 0.3], [50, 0.1]]\n");
    write("axes.csv",
          "alpha_deg,beta_deg,gamma_deg\n0,0,0\n90,0,0\n180,0,0\n270,0,0\n0,0,90\n90,0,90\n");
    const std::map<std::string, std::string> refusals{
        {"--sweeps 20,120 --config forty.toml",
         "--sweeps: found 20 to 120 Hz at 40 samples/s: with 68 of 300 s harmonics up to the 5th "
         "are off multiples of the rate"},
        {"--sweeps 20,120 --config forty.toml ", "expected 100 samples/s at least"},
        {"--sweeps 95,106 --config hundred.toml", "expected half of them at least"},
        {"--sweeps 120,20 --config hard.toml", "--sweeps: found 120 to 20 Hz, expected LOW,HIGH"},
        {"--sweeps 20,21 --config hard.toml", "10 % above the first"},
        {"--sweeps 20 --config hard.toml", "--sweeps"},
        {"--sweeps 20,nan --config hard.toml", "expected a finite number"},
        {"--sweeps 10,60 --config pads.toml", "--sweeps: found 10 to 60 Hz, expected 12.98"},
        {"--sweeps 20,60 --config short.toml", "where spectrum.transmission is known"},
        {"--sweeps 20,120 --config dull.toml",
         "expected frequencies of which the accelerometers see half of the power: at 101."},
        {"--sweeps 20,120 --sweep-s 86400 --config hard.toml",
         "in 86400 s, 0.00179511 octaves a minute, expected 0.01 at least"},
        {"--sweeps 1,20 --config hard.toml", "g at the table left by the limits at 1 Hz"},
        {"--sweeps 20,60 --sweep-s 9 --config hard.toml", "--sweep-s"},
        {"--sweep-s 100 --config hard.toml", "--sweeps"},
        {"--sweeps 20,60 --evaluate p.json --config hard.toml", "--evaluate"},
        {"--sweeps 20,60 --turntable", "--turntable"},
        {"--about nothing.json", "nothing.json: cannot be read, expected a JSON file"},
        {"--about empty.json",
         "empty.json: spectrum: found nothing, expected a result over frequency"},
        {"--about none.json", "none.json: found no JSON"},
        {"--about empty.json --highest 100", "--about"}};
    write("empty.json", "{}");
    write("none.json", "no");
    for (const auto& [arguments, words] : refusals) {
        EXPECT_EQ(vibrig("plan " + arguments), 2) << arguments;
        EXPECT_NE(error.find(words), std::string::npos) << arguments << ": " << error;
        EXPECT_LE(std::ranges::count(error, '\n'), 2) << arguments << ": " << error;
    }
    // A file of sweeps alone is no plan that can be judged.
    write(
        "alone.json",
        R"({"runs":[{"position":[0,0,0],"table_g":6,"sweep":{"from_hz":20,"to_hz":60,"s":99}}]})");
    EXPECT_EQ(vibrig("plan --evaluate alone.json --config hard.toml"), 2);
    EXPECT_NE(error.find("found sweeps alone, expected dwells beside them"), std::string::npos)
        << error;
}

}  // namespace
}  // namespace vibrig::plan::testing
