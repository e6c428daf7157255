#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/unit/support/temporary_folder.hpp"

namespace {

using ::testing::HasSubstr;

struct Answer {
    int exit_code = -1;
    std::string out, error;
};

/// Recordings with sweeps, by the real programs.
class Swept : public ::testing::Test {
  protected:
    [[nodiscard]] std::string content(const char* name) const {
        std::ostringstream text;
        text << std::ifstream(folder_ / name, std::ios::binary).rdbuf();
        return text.str();
    }
    Answer run(const std::string& program, const std::string& arguments) {
        const std::string command = "cd '" + folder_.string() + "' && '" + program +
                                    "' >out 2>error </dev/null " + arguments;
        const int status = std::system(command.c_str());
        return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, content("out"), content("error")};
    }
    Answer identify(const std::string& arguments) { return run(VIBRIG, "identify " + arguments); }
    /// A rig on a hard mount with this elastic part of gyros x, y, z, and its samples a second.
    void truth(const std::vector<double>& share, double rate_hz) {
        ASSERT_EQ(
            run(VIBRIG_PLANT, "record --dwell 1 --write-truth truth.json --table-g 6 -o x.csv")
                .exit_code,
            0);
        auto truth = nlohmann::json::parse(content("truth.json"));
        truth["isolator"]["hard"] = true;
        truth["elastic"]["share"] = share;
        truth["platform"]["sample_rate_hz"] = rate_hz;
        std::ofstream(folder_ / "truth.json") << truth.dump();
    }
    /// Table 1 at 15 Hz, seven positions at rest, sweeps up and down at three.
    void record(double dwell_s, const std::string& name, unsigned seed = 3) {
        std::string order;
        for (int p = 1; p <= 14; ++p) order += std::to_string(p) + ".1,";
        for (const int p : {4, 5, 6, 7, 10, 13, 14}) order += std::to_string(p) + ".2,";
        order += "4.3,4.4,6.3,6.4,14.3,14.4";
        const Answer done = run(VIBRIG_PLANT,
                                "record --truth truth.json --table-g 6,0,6,6 --frequency 15 "
                                "--sweep=-,-,40:90,90:40 --dwell " +
                                    std::to_string(dwell_s) + " --order " + order + " --seed " +
                                    std::to_string(seed) + " -o " + name);
        ASSERT_EQ(done.exit_code, 0) << done.error;
    }
    /// The frequency of each row of a sweep becomes another.
    void tell(const std::string& from, const std::string& to,
              const std::function<double(double)>& hz) {
        std::istringstream in(content(from.c_str()));
        std::ofstream out(folder_ / to);
        for (std::string line; std::getline(in, line);) {
            // Before the mark `simulated`.
            const auto last = line.rfind(',', line.rfind(',') - 1);
            const std::string text = line.substr(last + 1);
            const double is = std::atof(text.c_str());
            if (is < 20) {
                out << line << '\n';
                continue;
            }
            std::array<char, 32> digits{};
            std::snprintf(digits.data(), digits.size(), "%.4f", hz(is));
            out << line.substr(0, last + 1) << digits.data() << ",1\n";
        }
    }
    vibrig::TemporaryFolder folder_;
};

TEST_F(Swept, TellAResonanceBesideDwellsAtOneFrequency) {
    truth({0.5, -0.25, 0}, 400);
    record(64, "rec.csv");
    const Answer found = identify("rec.csv --json");
    ASSERT_LE(found.exit_code, 1) << found.error;
    const auto spectrum = nlohmann::json::parse(found.out).at("spectrum");
    EXPECT_EQ(spectrum["model"], "resonance");
    ASSERT_EQ(spectrum["sweeps"].size(), 6U);
    EXPECT_EQ(spectrum["sweeps"][1]["run"], 4);
    EXPECT_NEAR(spectrum["sweeps"][1]["from_hz"].get<double>(), 90, 0.1);
    EXPECT_NEAR(spectrum["sweeps"][1]["to_hz"].get<double>(), 40, 0.5);
    EXPECT_GT(spectrum["sweeps"][1]["used"], 50);
    EXPECT_TRUE(spectrum["flat"].is_null()) << "one frequency";
    for (const std::size_t gyro : {0U, 1U}) {
        EXPECT_GT(spectrum["log_odds"][gyro], 4);
        const auto& resonance = spectrum["resonance"][gyro];
        const double hz = resonance["hz"], low = resonance["hz_interval"][0],
                     high = resonance["hz_interval"][1];
        EXPECT_LT(std::abs(hz - 60), 4 * (high - low) / (2 * 1.96)) << hz;
        EXPECT_LT(high - low, 1) << "of 0.2 Hz, 1 sigma, for one sweep in 100 s";
    }
    EXPECT_LT(spectrum["log_odds"][2], 4);
    const Answer text = identify("rec.csv");
    EXPECT_THAT(text.out, HasSubstr("run 4 position 6: sweep from 90 to 40 Hz, "));
    EXPECT_THAT(text.out, HasSubstr("gyro x: elastic part, resonance at "));
    EXPECT_THAT(text.out, HasSubstr("Whether they are flat was not tested"));
}

TEST_F(Swept, AFrequencyThatLiesIsShownByTheAccelerometers) {
    truth({0.5, 0.5, 0.5}, 400);
    record(34, "rec.csv");
    const auto refused = [&](const std::function<double(double)>& hz, const std::string& message) {
        tell("rec.csv", "lies.csv", hz);
        const Answer ended = identify("lies.csv");
        EXPECT_EQ(ended.exit_code, 2);
        EXPECT_THAT(ended.error, HasSubstr("lies.csv:"));
        EXPECT_THAT(ended.error, HasSubstr("column frequency_hz: found " + message));
    };
    refused([](double hz) { return 1.02 * hz; }, "a sweep of which the accelerometers show 0.");
    refused([](double hz) { return hz + 1; }, "a sweep of which the accelerometers show 0.");
    refused([](double hz) { return 130 - hz; }, "a sweep of which the accelerometers show 0.");
    refused([](double hz) { return hz > 60 && hz < 65 ? 125 - hz : hz; }, "");
    refused([](double hz) { return hz > 60 && hz < 65 ? -hz : hz; }, "'-6");
    EXPECT_LE(identify("rec.csv").exit_code, 1) << "as it is";
}

TEST_F(Swept, SlowSamplesHaveFewSecondsOfThem) {
    truth({0, 0, 0}, 40);
    record(34, "rec.csv");
    const Answer ended = identify("rec.csv");
    EXPECT_EQ(ended.exit_code, 2);
    EXPECT_THAT(ended.error, HasSubstr("seconds of 34 that can be used, expected 10 at least: in "
                                       "others a harmonic falls on a multiple of the sampling"));
}

TEST_F(Swept, AloneTheyDetermineNothing) {
    truth({0, 0, 0}, 400);
    ASSERT_EQ(run(VIBRIG_PLANT,
                  "record --truth truth.json --table-g 6 --sweep 40:90 --dwell 34 "
                  "--order 1.1 -o rec.csv")
                  .exit_code,
              0);
    const Answer ended = identify("rec.csv");
    EXPECT_EQ(ended.exit_code, 2);
    EXPECT_THAT(ended.error, HasSubstr("rec.csv: found sweeps alone, expected dwells at one "
                                       "frequency as well"));
}

}  // namespace
