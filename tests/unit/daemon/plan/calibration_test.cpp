#include "estimator/plan/calibration.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>

#include "estimator/plan/positions.hpp"

namespace {

using namespace vibrig::estimator::plan;
using Json = nlohmann::json;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr Row kTruth{3e-3, 1.002, -4e-4, 2e-4, 5e-6, -2e-6, 1e-6, 3e-6, -1e-6, 2e-6};
constexpr double kSigma = 2e-6;

/// The model, written a second time.
double output_of(const Vec3& x) {
    const auto [d0, d1, d2, d3, d11, d22, d33, d12, d13, d23] = kTruth;
    return d0 + d1 * x[0] + d2 * x[1] + d3 * x[2] + d11 * x[0] * x[0] + d22 * x[1] * x[1] +
           d33 * x[2] * x[2] + d12 * x[0] * x[1] + d13 * x[0] * x[2] + d23 * x[1] * x[2];
}

/// The 26 directions on these spheres, each `times`, with noise and a cubic term of the input axis.
std::vector<Reading> readings(const std::vector<double>& spheres, int times, std::uint64_t seed,
                              bool stated, double cubic = 0) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    std::vector<Reading> list;
    for (int k = 0; k < times; ++k) {
        for (const double radius : spheres) {
            for (Vec3 x : cube_directions()) {
                for (double& value : x) value *= radius;
                list.push_back({x,
                                output_of(x) + cubic * std::pow(x[0], 3) + kSigma * normal(random),
                                stated ? kSigma : 0});
            }
        }
    }
    return list;
}

TEST(Calibration, SeedsShowErrorsAsLargeAsStated) {
    // GIVEN 100 tests on two spheres, the noise stated and not
    constexpr int kRuns = 100;
    for (const bool stated : {true, false}) {
        double squares = 0;
        int rejected = 0;
        for (unsigned run = 0; run < kRuns; ++run) {
            const SensorCalibration c = calibrate(readings({1, 2}, 2, 100 + run, stated));
            ASSERT_TRUE(c.test);
            rejected += c.test->probability < 0.05 ? 1 : 0;
            for (std::size_t k = 0; k < kTerms; ++k)
                squares += std::pow((c.value[k] - kTruth[k]) / c.sigma[k], 2) / (10.0 * kRuns);
        }
        // THEN z-rms is 1: 1000 numbers, 1 sigma 0.022; correlated ones at most three times that
        EXPECT_NEAR(std::sqrt(squares), 1, 0.1) << "seeds from 100, stated " << stated;
        // and the test of the residuals rejects one in twenty: binomial, 1 sigma 2.2
        EXPECT_NEAR(rejected, 5, 4 * 2.2) << "seeds from 100, stated " << stated;
    }
}

TEST(Calibration, SeedsShowThatAModelThatDoesNotHoldIsRejected) {
    // GIVEN a cubic term of 2 sigma at 1 g, 16 at 2 g, WHEN the ten terms are fitted
    for (unsigned run = 0; run < 20; ++run) {
        for (const bool stated : {true, false}) {
            const SensorCalibration c =
                calibrate(readings({1, 2}, 2, 300 + run, stated, 2 * kSigma));
            // THEN
            ASSERT_TRUE(c.test);
            EXPECT_LT(c.test->probability, 1e-3) << "seed " << 300 + run << ", stated " << stated;
        }
    }
}

TEST(Calibration, OneSphereLeavesTheBiasAndTheSquaresUndetermined) {
    const SensorCalibration c = calibrate(readings({1}, 2, 7, true));
    EXPECT_EQ(c.plan.rank, 9U);
    EXPECT_EQ(c.plan.undetermined(), "D0, D11, D22, D33");
    EXPECT_TRUE(std::isinf(c.sigma[0]));
    EXPECT_TRUE(std::isinf(c.sigma[4]));
    // What is determined is right all the same
    for (const std::size_t k : {1U, 2U, 3U, 7U, 8U, 9U})
        EXPECT_NEAR(c.value[k], kTruth[k], 4 * c.sigma[k]) << kTermNames[k];
    EXPECT_GT(c.test->probability, 1e-3);
}

TEST(Calibration, BadReadingsAreRefused) {
    const auto why = [](std::vector<Reading> list) -> std::string {
        try {
            static_cast<void>(calibrate(list));
        } catch (const PlanError& error) {
            return error.what();
        }
        return "";
    };
    std::vector<Reading> list = readings({1, 2}, 1, 1, true);
    EXPECT_NE(why({list.begin(), list.begin() + 9}).find("9 readings, expected 10"),
              std::string::npos);
    auto bad = list;
    bad[3].output = kNaN;
    EXPECT_NE(why(bad).find("reading 4"), std::string::npos);
    bad = list;
    bad[5].sigma = 0;
    EXPECT_NE(why(bad).find("reading 6: found sigma 0"), std::string::npos);
    bad[5].sigma = kNaN;
    EXPECT_NE(why(bad).find("reading 6"), std::string::npos);
    // As many readings as coefficients: a solution, nothing to judge it by
    Terms line{};
    line[0] = line[1] = true;
    const SensorCalibration c = calibrate({{{-1, 0, 0}, -2, 0}, {{1, 0, 0}, 4, 0}}, line);
    EXPECT_NEAR(c.value[0], 1, 1e-12);
    EXPECT_NEAR(c.value[1], 3, 1e-12);
    EXPECT_TRUE(std::isnan(c.sigma[1]));
    EXPECT_FALSE(c.test);
}

class CalibrateCommand : public ::testing::Test {
  protected:
    CalibrateCommand() {
        std::string name = (std::filesystem::temp_directory_path() / "vibrig-XXXXXX").string();
        folder_ = mkdtemp(name.data());
    }
    ~CalibrateCommand() override { std::filesystem::remove_all(folder_); }
    int vibrig(const std::string& arguments) {
        const std::string command =
            "cd '" + folder_.string() + "' && '" VIBRIG "' >out 2>error </dev/null " + arguments;
        const int status = std::system(command.c_str());
        out = content_of("out");
        error = content_of("error");
        return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    }
    std::string content_of(const std::string& name) const {
        std::ostringstream text;
        text << std::ifstream(folder_ / name, std::ios::binary).rdbuf();
        return text.str();
    }
    void write(const std::string& name, const std::string& text) const {
        std::ofstream(folder_ / name, std::ios::binary) << text;
    }
    void write(const std::string& name, const std::vector<Reading>& list) const {
        std::ostringstream text;
        text.precision(17);
        text << "x1,x2,x3,y\n";
        for (const Reading& r : list)
            text << r.input[0] << ',' << r.input[1] << ',' << r.input[2] << ',' << r.output << '\n';
        write(name, text.str());
    }

    std::filesystem::path folder_;
    std::string out, error;
};

TEST_F(CalibrateCommand, FillsInTheFileThatThePlanWrote) {
    // GIVEN a plan for two spheres
    ASSERT_EQ(vibrig("plan --turntable --spheres 1,2 --runs 40 --json -o turntable.csv"), 0)
        << error;
    const Json plan = Json::parse(out);
    EXPECT_EQ(plan["run_count"], 40);
    EXPECT_EQ(plan["rank"], 10);
    EXPECT_GT(plan["d_efficiency"], 0.98);
    // WHEN the outputs are filled in
    std::istringstream lines(content_of("turntable.csv"));
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
    EXPECT_EQ(content_of("r.svg").substr(0, 4), "<svg");
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
    std::vector<Reading> list = readings({1, 2}, 2, 3, true);
    list[10].output += 20 * kSigma;
    write("outlier.csv", list);
    EXPECT_EQ(vibrig("calibrate outlier.csv --sigma 2e-6"), 1);
    EXPECT_NE(out.find("line 12:"), std::string::npos) << out;
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

TEST_F(CalibrateCommand, RefusesBadInputWithPlaceAndValue) {
    write("empty.csv", "");
    write("header.csv", "x1,x2,x3,y\n");
    write("none.csv", "x1,x2,y\n1,2,3\n");
    write("word.csv", "x1,x2,x3,y\n1,0,0,1\n0,1,0,one\n");
    write("nan.csv", "x1,x2,x3,y\n1,0,0,nan\n");
    write("cut.csv", "x1,x2,x3,y\n1,0,0\n");
    write("few.csv", "x1,x2,x3,y\n1,0,0,1\n");
    write("sigma.csv", "x1,x2,x3,y,sigma\n1,0,0,1,-2\n");
    write("count.csv", "x1,x2,x3,y,count\n1,0,0,1,4\n");
    struct Case {
        const char* arguments;
        const char* words;
    };
    for (const Case& c :
         {Case{"calibrate missing.csv", "missing.csv"},
          Case{"calibrate empty.csv", "empty.csv"},
          Case{"calibrate header.csv", "header.csv"},
          Case{"calibrate none.csv", "no column x3"},
          Case{"calibrate word.csv", "word.csv:3: column y: found 'one'"},
          Case{"calibrate nan.csv", "nan.csv:2: column y: found 'nan'"},
          Case{"calibrate cut.csv", "cut.csv:2: column y: found nothing"},
          Case{"calibrate few.csv", "few.csv: found 1 readings, expected 10"},
          Case{"calibrate sigma.csv", "sigma.csv:2: column sigma: found -2"},
          Case{"calibrate sigma.csv --sigma 1", "--sigma and a column sigma"},
          Case{"calibrate count.csv", "count.csv:2: column count"},
          Case{"calibrate few.csv --sigma nan", "--sigma"},
          Case{"calibrate few.csv --without D9", "--without: found \"D9\""},
          Case{"plan --turntable --spheres 2,1", "--spheres: found 1"},
          Case{"plan --turntable --spheres 0,1", "--spheres"},
          Case{"plan --turntable --spheres 1,nan", "--spheres"},
          Case{"plan --turntable --runs 9", "9 runs for 10 coefficients"},
          Case{"plan --turntable --spheres 1,2,3 --allocation both", "--allocation: found both"},
          Case{"plan --turntable --levels 0,6", "--levels"},
          Case{"plan --spheres 1,2", "--turntable"}}) {
        EXPECT_EQ(vibrig(c.arguments), 2) << c.arguments << out << error;
        EXPECT_NE(error.find(c.words), std::string::npos) << c.arguments << ": " << error;
    }
}

}  // namespace
