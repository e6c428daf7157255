#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "tests/unit/estimator/plan/calibration_readings.hpp"
#include "tests/unit/support/vibrig_command.hpp"

namespace vibrig::tool {
namespace {

using estimator::plan::kSigma;
using estimator::plan::kTermNames;
using estimator::plan::kTerms;
using estimator::plan::kTruth;
using estimator::plan::output_of;
using estimator::plan::Reading;
using estimator::plan::readings;
using estimator::plan::Vec3;
using Json = nlohmann::json;

std::string csv_row(const std::vector<double>& numbers) {
    std::ostringstream text;
    text.precision(17);
    for (std::size_t i = 0; i < numbers.size(); ++i) text << (i > 0 ? "," : "") << numbers[i];
    return text.str() + '\n';
}
std::string many(const std::string& row, int count) {
    std::string text;
    for (int i = 0; i < count; ++i) text += row;
    return text;
}

class CalibrateCommand : public vibrig::test::VibrigCommand {
  protected:
    using VibrigCommand::write;
    void write(const std::string& name, const std::vector<Reading>& list) const {
        std::ostringstream text;
        text.precision(17);
        text << "# turntable, by hand\nx1,x2,x3,y\n";
        for (const Reading& r : list)
            text << r.input[0] << ',' << r.input[1] << ',' << r.input[2] << ',' << r.output << '\n';
        write(name, text.str());
    }
};

TEST_F(CalibrateCommand, AFileWithoutItsLastEndIsTakenWithAWarning) {
    // GIVEN readings under a header of its own case
    write("whole.csv", readings({1, 2}, 2, 3, true));
    std::string text = content("whole.csv");
    text.replace(text.find("x1,x2"), 5, "X1, X2 ");
    write("whole.csv", text);
    ASSERT_EQ(vibrig("calibrate whole.csv --json"), 0) << error;
    EXPECT_EQ(Json::parse(out)["warnings"], Json::array());
    EXPECT_EQ(error, "");
    // WHEN it is cut within its last number
    write("cut.csv", text.substr(0, text.size() - 3));
    static_cast<void>(vibrig("calibrate cut.csv --json"));
    // THEN people and programs hear of it
    EXPECT_NE(error.find("warning: cut.csv:106: found no end of line behind '"), std::string::npos)
        << error;
    EXPECT_NE(Json::parse(out)["warnings"].dump().find("cut.csv:106: found no end of line"),
              std::string::npos)
        << out;
}

TEST_F(CalibrateCommand, FillsInTheFileThatThePlanWrote) {
    // GIVEN a plan for two spheres
    ASSERT_EQ(vibrig("plan --turntable --spheres 1,2 --runs 40 --json -o turntable.csv"), 0)
        << error;
    const Json plan = Json::parse(out);
    EXPECT_EQ(plan["run_count"], 40);
    EXPECT_EQ(plan["rank"], 10);
    EXPECT_GT(plan["d_efficiency"], 0.98);
    // WHEN the outputs are filled in
    std::istringstream lines(content("turntable.csv"));
    std::ostringstream filled;
    filled.precision(17);
    std::string line;
    std::getline(lines, line);
    filled << line << '\n';
    std::mt19937_64 random(5);
    std::normal_distribution<double> normal(0, kSigma);
    for (; std::getline(lines, line);) {
        int run = 0;
        Vec3 x{};
        ASSERT_EQ(std::sscanf(line.c_str(), "%d,%lf,%lf,%lf,", &run, &x[0], &x[1], &x[2]), 4);
        filled << line << output_of(x) + normal(random) << '\n';
    }
    write("filled.csv", filled.str());
    // THEN the coefficients come back with errors as the plan promised
    ASSERT_EQ(vibrig("calibrate filled.csv --sigma 2e-6 --json --plot r.svg"), 0) << error;
    const Json result = Json::parse(out);
    EXPECT_TRUE(result["test"]["passed"]);
    EXPECT_EQ(result["degrees_of_freedom"], 30);
    for (std::size_t k = 0; k < kTerms; ++k) {
        const Json& c = result["coefficients"][k];
        EXPECT_NEAR(c["sigma"].get<double>(),
                    kSigma * plan["unit_standard_errors"][kTermNames[k]].get<double>(), 1e-12);
        EXPECT_NEAR(c["value"].get<double>(), kTruth[k], 4.5 * c["sigma"].get<double>());
    }
    EXPECT_EQ(content("r.svg").substr(0, 4), "<svg");
    EXPECT_EQ(vibrig("calibrate filled.csv --sigma 2e-6"), 0);
    EXPECT_NE(out.find("the model holds"), std::string::npos) << out;
}

TEST_F(CalibrateCommand, SaysNoWhereTheReadingsDo) {
    write("one.csv", readings({1}, 2, 3, true));
    EXPECT_EQ(vibrig("calibrate one.csv --sigma 2e-6 --json"), 1);
    EXPECT_NE(error.find("D0, D11, D22, D33"), std::string::npos) << error;
    EXPECT_TRUE(Json::parse(out)["coefficients"][0]["value"].is_null());
    EXPECT_EQ(Json::parse(out)["null_vectors"].size(), 1U);
    write("cubic.csv", readings({1, 2}, 2, 3, true, 2 * kSigma));
    EXPECT_EQ(vibrig("calibrate cubic.csv"), 1);
    EXPECT_NE(out.find("does NOT hold"), std::string::npos) << out;
    // Readings of a coarse converter agree exactly: what the model leaves may be its steps, or not.
    std::vector<Reading> coarse = readings({1, 2}, 1, 3, true, 0.05);
    for (Reading& r : coarse) r.output = std::round(r.output * 100) / 100;
    coarse.insert(coarse.end(), coarse.begin(), coarse.end());
    write("coarse.csv", coarse);
    EXPECT_EQ(vibrig("calibrate coarse.csv"), 0);
    EXPECT_NE(
        out.find("no test of the residuals: repeated readings agree exactly, the model leaves "
                 "0.0"),
        std::string::npos)
        << out;
    std::vector<Reading> list = readings({1, 2}, 2, 3, true);
    list[10].output += 20 * kSigma;
    write("outlier.csv", list);
    EXPECT_EQ(vibrig("calibrate outlier.csv --sigma 2e-6"), 1);
    EXPECT_NE(out.find("line 13:"), std::string::npos) << out;
}

TEST_F(CalibrateCommand, TurntablePlansAreThePapers) {
    // The whole double sphere of 192 runs: D-efficiency 0.746 at r = 2, det ~ r^30
    ASSERT_EQ(vibrig("plan --turntable --allocation both --json"), 0) << error;
    Json plan = Json::parse(out);
    EXPECT_EQ(plan["run_count"], 192);
    EXPECT_NEAR(plan["d_efficiency"], 0.746, 5e-4);
    EXPECT_NEAR(plan["growth_exponent"], 30, 0.1);
    ASSERT_EQ(vibrig("plan --turntable --allocation split-68 --spheres 1,3 --json"), 0) << error;
    plan = Json::parse(out);
    EXPECT_EQ(plan["run_count"], 96);
    EXPECT_NEAR(plan["d_efficiency"], 0.413, 5e-4);
    EXPECT_EQ(vibrig("plan --turntable --spheres 1"), 1);
    EXPECT_NE(error.find("rank 9 of 10"), std::string::npos) << error;
}

TEST_F(CalibrateCommand, TheLargestAndSmallestNumbersGiveNumbers) {
    // GIVEN sigmas and a reading at the very limits
    write("fine.csv", readings({1, 2}, 2, 3, true));
    std::vector<Reading> far = readings({1, 2}, 2, 3, true);
    far.push_back({{1e12, -1e12, 1e12}, 1e30, 0});
    write("far.csv", far);
    for (const char* arguments : {"fine.csv --sigma 1e-30", "fine.csv --sigma 1e30",
                                  "far.csv --sigma 1e-30", "far.csv --sigma 1e30", "far.csv"}) {
        // THEN there is a result, and what is printed is a number or null
        const int code = vibrig(std::string("calibrate --json ") + arguments);
        EXPECT_TRUE(code == 0 || code == 1) << arguments << ": " << code << error;
        EXPECT_TRUE(Json::accept(out)) << arguments << out;
        EXPECT_EQ((out + error).find("nan"), std::string::npos) << arguments << out << error;
    }
}

TEST_F(CalibrateCommand, RefusesBadInputWithPlaceAndValue) {
    write("empty.csv", "");
    write("header.csv", "x1,x2,x3,y\n");
    write("none.csv", "x1,x2,y\n1,2,3\n");
    write("word.csv", "x1,x2,x3,y\n1,0,0,1\n0,1,0,one\n");
    write("nan.csv", "x1,x2,x3,y\n1,0,0,nan\n");
    write("cut.csv", "x1,x2,x3,y\n1,0,0\n");
    write("few.csv", "x1,x2,x3,y\n1,0,0,1\n");
    write("comma.csv", "x1,x2,x3,y\n1,0,0,1\n-1,0,0,0,505\n");
    write("sigma.csv", "x1,x2,x3,y,sigma\n1,0,0,1,-2\n");
    write("count.csv", "x1,x2,x3,y,count\n1,0,0,1,4\n");
    write("still.csv", "x1,x2,x3,y\n" + many("0,0,0,1\n", 12));
    // What overflows on the way to a result: one line of it crashed.
    std::string good = "x1,x2,x3,y,sigma,count\n";
    for (const Reading& r : readings({1, 2}, 2, 3, true))
        good += csv_row({r.input[0], r.input[1], r.input[2], r.output, 2e-6, 1});
    write("x.csv", good + "1e78,0,0,1,2e-6,1\n");
    write("x3.csv", good + "0,0,-1e154,1,2e-6,1\n");
    write("y.csv", good + "1,0,0,1e300,2e-6,1\n");
    write("small.csv", good + "1,0,0,1,1e-155,1\n");
    write("large.csv", good + "1,0,0,1,1e300,1\n");
    write("mean.csv", good + "1,0,0,1,2e-6,1e300\n");
    write("fine.csv", readings({1, 2}, 2, 3, true));
    struct Case {
        const char* arguments;
        const char* words;
    };
    for (const Case& c :
         {Case{"calibrate missing.csv", "missing.csv"},
          Case{"calibrate empty.csv", "empty.csv"},
          Case{"calibrate header.csv", "header.csv"},
          Case{"calibrate none.csv",
               "no column x3, expected the columns x1, x2, x3 and y, and sigma and count if known"},
          Case{"calibrate word.csv", "word.csv:3: column y: found 'one'"},
          Case{"calibrate nan.csv", "nan.csv:2: column y: found 'nan'"},
          Case{"calibrate comma.csv", "comma.csv:3: found 5 fields, expected 4 as in the header"},
          Case{"calibrate cut.csv", "cut.csv:2: column y: found nothing"},
          Case{"calibrate few.csv", "few.csv: found 1 readings, expected 10"},
          Case{"calibrate sigma.csv", "sigma.csv:2: column sigma: found -2"},
          Case{"calibrate sigma.csv --sigma 1", "--sigma and a column sigma"},
          Case{"calibrate count.csv", "count.csv:2: column count"},
          Case{"calibrate few.csv --sigma nan", "--sigma"},
          Case{"calibrate fine.csv --sigma 1e-153",
               "--sigma: found 1e-153, expected a finite number from 1e-30 up to 1e+30"},
          Case{"calibrate fine.csv --sigma 1e-308", "expected a finite number from 1e-30"},
          Case{"calibrate fine.csv --sigma 1e308", "--sigma: found 1e308"},
          Case{"calibrate x.csv",
               "x.csv:106: column x1: found 1e+78, expected a number from -1e+12 to 1e+12"},
          Case{"calibrate x3.csv", "x3.csv:106: column x3: found -1e+154"},
          Case{"calibrate y.csv",
               "y.csv:106: column y: found 1e+300, expected a number from -1e+30 to 1e+30"},
          Case{"calibrate small.csv",
               "small.csv:106: column sigma: found 1e-155, expected a number from 1e-30 to 1e+30"},
          Case{"calibrate large.csv", "large.csv:106: column sigma: found 1e+300"},
          Case{"calibrate mean.csv",
               "mean.csv:106: column count: found 1e+300, expected a number from 1 to 1e+12"},
          Case{"calibrate still.csv --without D0", "still.csv: found inputs of 0 alone"},
          Case{"calibrate few.csv --without D9", "--without: found \"D9\""},
          Case{"plan --turntable --spheres 2,1", "--spheres: found 1"},
          Case{"plan --turntable --spheres 0,1", "--spheres"},
          Case{"plan --turntable --spheres 1,nan", "--spheres"},
          Case{"plan --turntable --runs 9", "--runs: found 9, expected 10 at least"},
          Case{"plan --turntable --spheres 1,2,3 --allocation both", "--allocation: found both"},
          Case{"plan --turntable --levels 0,6", "--levels"},
          Case{"plan --turntable --outer 0,6", "--outer"},
          Case{"plan --turntable --noise-per-g 1", "--noise-per-g"},
          Case{"plan --turntable --order random", "--order"},
          Case{"plan --spheres 1,2", "--turntable"}}) {
        EXPECT_EQ(vibrig(c.arguments), 2) << c.arguments << out << error;
        EXPECT_NE(error.find(c.words), std::string::npos) << c.arguments << ": " << error;
    }
}

}  // namespace
}  // namespace vibrig::tool
