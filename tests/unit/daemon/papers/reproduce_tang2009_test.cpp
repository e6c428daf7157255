#include <gtest/gtest.h>

#include <cctype>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "tests/unit/support/vibrig_command.hpp"

namespace {

using Json = nlohmann::json;

class Reproduce : public vibrig::test::VibrigCommand {
  protected:
    /// The row with this item; its verdict must be good.
    Json row_of(const std::string& item) {
        for (const Json& row : reproduction["rows"]) {
            if (row["item"] != item) continue;
            EXPECT_EQ(row["agrees"], true) << row;
            return row;
        }
        ADD_FAILURE() << "no row " << item;
        return {{"values", {{"computed", NAN}}}};
    }
    double computed(const std::string& item) {
        return row_of(item)["values"].value("computed", NAN);
    }

    static void expect_whole(const Json& row) {
        EXPECT_TRUE(row["item"] == "not observable at rest" || !row["values"].empty()) << row;
        EXPECT_TRUE(row.contains("theory"));
        // What is published is what is in print, no demand of ours.
        for (const char* ours : {"at most", "at least", "theory", "within", "("}) {
            EXPECT_EQ(row["published"].get<std::string>().find(ours), std::string::npos) << row;
        }
    }

    Json reproduction;
};

TEST_F(Reproduce, RefusesAPlaceForChartsBeforeTheStudy) {
    std::ofstream(folder_ / "file") << "no folder";
    const auto refusal_of = [&](const std::string& arguments) {
        EXPECT_EQ(vibrig("reproduce " + arguments), 2) << arguments;
        EXPECT_EQ(out, "");
        return error;
    };
    EXPECT_EQ(refusal_of("tang2009 --plot file"),
              "reproduce: --plot: found file, expected a folder for charts\n");
    EXPECT_EQ(refusal_of("tang2009 --plot ''"),
              "--plot: found nothing, expected a value: folder for charts (SVG)\n"
              "Run with --help for more information.\n");
    EXPECT_NE(refusal_of("tang2009 --plot file/below").find("file/below"), std::string::npos);
}

TEST_F(Reproduce, LinesAreAtMost120ColumnsAndEveryRowHasValues) {
    for (const std::string name : {"dplan", "zha2019 --seeds 2", "accelerometer --seeds 2",
                                   "allan --seeds 2", "tang2009 --seeds 2"}) {
        ASSERT_LE(vibrig("reproduce " + name + " --plot charts"), 1) << error;
        std::istringstream lines(out);
        for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 120U) << line;
        EXPECT_NE(out.find("theory"), std::string::npos);
        EXPECT_NE(out.find("seed"), std::string::npos) << name << ": what was drawn is not named";
    }
    for (const char* chart :
         {"dplan-growth.svg", "dplan-allocation.svg", "accelerometer-zeros.svg",
          "zha2019-start.svg", "zha2019-four-hours.svg", "zha2019-drive.svg",
          "zha2019-internal.svg", "zha2019-velocity.svg", "zha2019-networks.svg",
          "zha2019-drift.svg", "zha2019-schedule.svg", "zha2019-noisy-reference.svg",
          "allan-surface.svg", "allan-coefficients.svg", "allan-deviation.svg",
          "tang2009-figure3-12g-trial3-one-level-z.svg"})
        EXPECT_TRUE(std::filesystem::exists(folder_ / "charts" / chart)) << chart;
    for (const auto& file : std::filesystem::directory_iterator(folder_ / "charts")) {
        const std::string text = content("charts/" + file.path().filename().string());
        const std::size_t begin = text.find("<title>") + 7;
        const std::string title = text.substr(begin, text.find("</title>") - begin);
        EXPECT_TRUE(std::isalnum(static_cast<unsigned char>(title.back())) != 0 ||
                    title.back() == ')')
            << file.path() << ": " << title;
    }
    // The tilt that is left there is that of the table's row, which is of the gains as printed.
    EXPECT_NE(content("charts/zha2019-drift.svg").find("gains as printed"), std::string::npos);
    for (const std::string name :
         {"dplan", "zha2019 --seeds 2", "accelerometer --seeds 2", "allan --seeds 2"}) {
        ASSERT_LE(vibrig("reproduce " + name + " --json"), 1) << error;
        const Json result = Json::parse(out)["reproductions"][0];
        for (const Json& row : result["rows"]) expect_whole(row);
    }
}

// What four seeds make of their own scatter is no measure of it: a band that says 99.9 or 99.7 %
// has to know how many they are.
TEST_F(Reproduce, BandsWithAProbabilityHoldAtFewSeedsToo) {
    ASSERT_LE(vibrig("reproduce tang2009 --json --seeds 4"), 1) << error;
    reproduction = Json::parse(out)["reproductions"][0];
    int with_probability = 0;
    for (const Json& row : reproduction["rows"]) {
        if (row["theory"].get<std::string>().find("(99.") == std::string::npos) continue;
        ++with_probability;
        EXPECT_EQ(row["agrees"], true) << row;
    }
    EXPECT_EQ(with_probability, 25);
    // Twelve errors, which hardly correlate: 0.05 and 99.95 % of their chi-square.
    const Json bias =
        row_of("12 g: trial 2, joint, bias, rms relative error, %, against theory")["values"];
    const double theory = bias["theory"];
    EXPECT_NEAR(bias["at_least"].get<double>() / theory, std::sqrt(1.9344 / 12), 0.02);
    EXPECT_NEAR(bias["at_most"].get<double>() / theory, std::sqrt(34.821 / 12), 0.02);
    // The paper's one draw against their mean: Student's 8.891 of 3 degrees of freedom.
    const Json row = row_of(
        "12 g: trial 1, two-step, bias, rms relative error, %, against the paper's one draw");
    const double sigma = row["values"]["sigma"];
    EXPECT_NEAR(std::stod(row["theory"].get<std::string>().substr(7)),
                8.891 * sigma * std::sqrt(1.25), 0.01 * 8.891 * sigma);
}

// The rigs' seeds are 1, 2, ... in every run, so the numbers are the same in every run. How many
// there are is the command's own choice, 16. With 8 the joint error at 6 g has a standard
// deviation of 11 % and lies 2 % below its limit, which would test luck; 32 take twice the minute.
TEST_F(Reproduce, Tang2009) {
    ASSERT_EQ(vibrig("reproduce tang2009 --json --plot charts"), 0) << out << error;
    reproduction = Json::parse(out)["reproductions"][0];
    EXPECT_EQ(reproduction["name"], "tang2009");
    EXPECT_EQ(reproduction["agrees"], true);
    for (const Json& row : reproduction["rows"]) {
        EXPECT_FALSE(row["values"].empty()) << row;
        expect_whole(row);
    }

    // Against the limits that are demanded, not against what the command makes of them.
    EXPECT_LE(computed("12 g: joint, rms relative error, %"), 0.5);
    EXPECT_LE(computed("6 g: joint, rms relative error, %"), 1.4);
    EXPECT_GE(computed("6 g: two-step over joint, all 30"), 2);
    EXPECT_GE(computed("6 g: two-step over joint, bias"), 3);
    EXPECT_LE(computed("6 g with rest: joint, bias, %"), 0.3);
    EXPECT_LE(computed("6 g with rest: joint, linear, %"), 0.35);
    EXPECT_LE(computed("6 g with rest: joint, squares, %"), 1.0);
    EXPECT_LE(computed("6 g with rest: joint, products, %"), 2.2);
    for (const std::string level : {"6 g", "12 g"}) {
        for (const std::string trial : {"1", "2"}) {
            for (const std::string group : {"all 30", "bias", "linear", "squares", "products"}) {
                EXPECT_LE(computed(level + ": trial " + trial + ", joint over two-step, " + group),
                          1);
            }
        }
        // The findings: by numbers.
        const Json order =
            row_of(level + ": error of second-order terms, trial 2 over trial 1")["values"];
        EXPECT_GE(order["joint"], level == "6 g" ? 8 : 10);
        EXPECT_NEAR(order["published"], 28.7, 0.1);
        EXPECT_EQ(
            computed(level + ": one level with the joint filter, seeds in which it passed for two"),
            0);
        for (const std::string group : {"bias", "squares"}) {
            EXPECT_GE(computed(level + ": trial 3, error of " + group +
                               " over that of the joint filter with 9/7 g"),
                      10);
        }
        // In print they are the same, here they are not: nothing but a change is found by this.
        for (const std::string group : {"linear", "products"}) {
            const std::string item =
                level + ": trial 3, " + group + " less those of trial 1, rms over sigma";
            bool found = false;
            for (const Json& row : reproduction["rows"]) {
                if (row["item"] == item) {
                    found = true;
                    EXPECT_LE(row["values"]["computed"], level == "6 g" ? 0.5 : 2) << item;
                    EXPECT_EQ(row["values"]["published"], 0);
                }
            }
            EXPECT_TRUE(found) << item;
        }
        const Json bound = row_of(level +
                                  ", joint, trial 1: rms of error over Cramer-Rao bound (1.05, or "
                                  "the 95 % chi-square limit of 16 seeds)")["values"];
        EXPECT_LE(bound["computed"], bound["at_most"]);
        EXPECT_LE(bound["at_most"], 1.08);
    }

    // Two-sided: the joint filter is as good as theory says, no worse and no better, and the
    // two-step route with plain eq. 13 makes the paper's own errors at the doubled levels.
    for (const std::string group : {"all 30", "bias", "linear", "squares", "products"}) {
        for (const std::string row : {"6 g: trial 1, joint, ", "12 g: trial 1, joint, ",
                                      "6 g: trial 2, joint, ", "12 g: trial 2, joint, "}) {
            const Json theory =
                row_of(row + group + ", rms relative error, %, against theory")["values"];
            EXPECT_NEAR(theory["computed"], theory["theory"], 3.29 * theory["sigma"].get<double>());
            EXPECT_LT(theory["sigma"], 0.2 * theory["theory"].get<double>()) << row << group;
        }
        const Json paper =
            row_of("12 g: trial 1, two-step, " + group +
                   ", rms relative error, %, against the paper's one draw")["values"];
        EXPECT_NEAR(paper["computed"], paper["published"], 0.25 * paper["published"].get<double>());
    }

    // Table 2, with sigma of both routes.
    const Json& first = reproduction["rows"][0];
    EXPECT_EQ(first["item"], "Table 2, trial 1, D_Fx (truth 1)");
    EXPECT_EQ(first["values"]["published"], 0.9336);
    EXPECT_NEAR(first["values"]["joint_sigma_6g"], 0.006003, 6e-5);
    EXPECT_GT(first["values"]["two_step_sigma_6g"], 0.006);
    EXPECT_NE(first["computed"].get<std::string>().find("12 g: two-step"), std::string::npos);

    // Eq. 4 at 15 Hz and a ratio of 0.65, as printed and as it must be.
    const std::string mount = "eqs 3-7, mount of 9.1 Hz, damping 0.2: ";
    EXPECT_NEAR(row_of(mount + "a0/a at 15 Hz")["values"]["formula"], 0.651, 5e-4);
    const Json phase = row_of(mount + "phase, rad")["values"];
    EXPECT_NEAR(phase["as_printed"], -0.22, 5e-3);
    EXPECT_NEAR(phase["corrected"], -2.19, 5e-3);
    EXPECT_NEAR(phase["integrated"], phase["corrected"], 1e-4);

    // Section 3.5.
    EXPECT_NEAR(computed("section 3.5, their sum"), 14, 0.05);
    EXPECT_NEAR(computed("section 3.5, the same per misalignment E_xy + E_yx"), -1, 0.02);
    EXPECT_NEAR(computed("section 3.5, Delta of second-order terms, scale error 1e-3 of all three "
                         "axes"),
                -18.0 / 19 * 4e-3, 2e-5);  // 4 dk of a0^2, to first order

    std::size_t charts = 0;
    for (const auto& file : std::filesystem::directory_iterator(folder_ / "charts")) {
        const std::string text = content("charts/" + file.path().filename().string());
        EXPECT_EQ(text.find("<svg"), 0U) << file.path();
        EXPECT_NE(text.find("D_IO"), std::string::npos) << file.path();
        EXPECT_NE(text.find("<path"), std::string::npos) << file.path();
        ++charts;
    }
    // Three trials, the first two by either route, three gyros, two levels.
    EXPECT_EQ(charts, 30U);
}

}  // namespace
