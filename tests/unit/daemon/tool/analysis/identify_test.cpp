#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>
#include <sstream>

#include "tests/unit/support/temporary_folder.hpp"

namespace {

using Json = nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

std::string content_of(const std::filesystem::path& path) {
    std::ostringstream text;
    text << std::ifstream(path, std::ios::binary).rdbuf();
    return text.str();
}

struct Outcome {
    int exit_code = -1;
    std::string out;
    std::string error;
};

/// Runs the real programs in a folder of their own.
class Identify : public ::testing::Test {
  protected:
    Outcome run(const std::string& program, const std::string& arguments) {
        // Redirections first, so that those among the arguments win.
        const std::string command = "cd '" + folder_.string() + "' && '" + program +
                                    "' >out 2>error </dev/null " + arguments;
        const int status = std::system(command.c_str());
        return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, content_of(folder_ / "out"),
                content_of(folder_ / "error")};
    }
    Outcome vibrig(const std::string& arguments) { return run(VIBRIG, arguments); }
    void record(const std::string& arguments) {
        const Outcome outcome = run(VIBRIG_PLANT, "record --seed 11 -o rec.csv " + arguments);
        ASSERT_EQ(outcome.exit_code, 0) << outcome.error;
    }
    void write(const std::string& name, const std::string& text) {
        std::ofstream(folder_ / name, std::ios::binary) << text;
    }

    vibrig::TemporaryFolder folder_;
};

const std::string kHeader = "time_s,run,position,alpha_deg,beta_deg,gamma_deg,ax_g,ay_g,az_g\n";

TEST_F(Identify, FindsAllThirtyWithinFourSigma) {
    // GIVEN the 14 positions at two amplitudes, recorded by the simulated rig with seed 11
    record("--dwell 40");
    // WHEN the recording is identified
    const Outcome outcome = vibrig("identify rec.csv --json");
    // THEN everything is observable and the rig's own judge agrees
    ASSERT_EQ(outcome.exit_code, 0) << outcome.error;
    EXPECT_EQ(outcome.error, "") << "no progress where there is no terminal";
    write("result.json", outcome.out);
    const Outcome verdict = run(VIBRIG_PLANT, "judge result.json");
    EXPECT_EQ(verdict.exit_code, 0) << verdict.out << verdict.error;
    const Json result = Json::parse(outcome.out);
    EXPECT_EQ(result["combinations"].size(), 0U);
    EXPECT_EQ(result["samples"], 2 * 14 * 40 * 40);
    ASSERT_EQ(result["amplitudes"].size(), 2U);
    EXPECT_NEAR(result["amplitudes"][0]["amplitude_g"].get<double>(), 6.0, 0.05);
    EXPECT_NEAR(result["amplitudes"][1]["frequency_hz"].get<double>(), 15.0, 0.01);
    // and people get the same as a table
    const Outcome table = vibrig("identify rec.csv");
    EXPECT_EQ(table.exit_code, 0);
    EXPECT_THAT(table.out, AllOf(HasSubstr("D_OSz"), HasSubstr("deg/h/g^2"), HasSubstr("NIS"),
                                 Not(HasSubstr("nan")), Not(HasSubstr("Not observable"))));
}

TEST_F(Identify, TellsACutRecordingAndASimulatedOne) {
    record("--dwell 2");
    const Outcome whole = vibrig("identify rec.csv --json");
    EXPECT_EQ(Json::parse(whole.out)["simulated"], true);
    EXPECT_EQ(whole.error, "");
    // The last number before the mark is cut, the mark with it.
    const std::string text = content_of(folder_ / "rec.csv");
    write("rec.csv", text.substr(0, text.size() - 4));
    EXPECT_THAT(vibrig("identify rec.csv").error,
                HasSubstr("9 fields and no end of line, expected 10: the file was cut"));
    write("rec.csv", text.substr(0, text.size() - 1));
    const Outcome open = vibrig("identify rec.csv --json");
    EXPECT_THAT(open.error, HasSubstr("warning: rec.csv:2241: found no end of line behind '1'"));
    EXPECT_THAT(Json::parse(open.out)["warnings"].dump(), HasSubstr("no end of line"));
}

TEST_F(Identify, HoldsOutWhatIsToVerifyAtOneFrequencyToo) {
    // GIVEN a recording at one frequency whose fourth dwell is to prove the result
    record("--dwell 10");
    std::istringstream recording(content_of(folder_ / "rec.csv"));
    std::string text, line;
    std::getline(recording, line);
    const std::string head = line;
    for (text = head + ",role\n"; std::getline(recording, line);) {
        std::istringstream fields(line);
        std::string time, run, position;
        std::getline(std::getline(std::getline(fields, time, ','), run, ','), position, ',');
        text += line + (run == "1" && position == "4" ? ",verify\n" : ",\n");
    }
    write("held.csv", text);
    // WHEN it is identified
    const Outcome outcome = vibrig("identify held.csv --json");
    // THEN that dwell is no part of it
    ASSERT_EQ(outcome.exit_code, 0) << outcome.error;
    EXPECT_EQ(Json::parse(outcome.out)["dwell_rates"].size(), 27U);
    // and a method that would fit it says so
    write("two.toml", "[estimator]\nmethod = \"two-step\"\n");
    const Outcome two = vibrig("identify held.csv --config two.toml");
    EXPECT_EQ(two.exit_code, 2);
    EXPECT_THAT(two.error, HasSubstr("role: found \"verify\" with estimator.method"));
}

TEST_F(Identify, WithOneAmplitudeGivesCombinationsInsteadOfNumbers) {
    // GIVEN one amplitude only
    record("--dwell 20 --table-g 9");
    // WHEN the recording is identified
    const Outcome outcome = vibrig("identify rec.csv --json");
    // THEN it is stated before what cannot be determined
    EXPECT_EQ(outcome.exit_code, 1) << outcome.error;
    EXPECT_THAT(outcome.error, HasSubstr("before the run: these positions and levels do not "
                                         "determine one by one: D_Fx D_IIx"));
    // AND of each gyro, what is: the weight is the level as measured, 19 to 3e-5 after 10 s
    for (const std::string gyro : {"x", "y", "z"}) {
        std::smatch weight;
        const std::regex sum("determined is D_F" + gyro + " \\+ (\\d+\\.?\\d*) D_OO" + gyro +
                             ", expected sigma 0\\.0\\d+\n");
        ASSERT_TRUE(std::regex_search(outcome.error, weight, sum)) << outcome.error;
        EXPECT_NEAR(std::stod(weight[1]), 19, 19 * 3e-5) << gyro;
        EXPECT_THAT(outcome.error, HasSubstr("determined is D_II" + gyro + " - D_OO" + gyro + ","));
        EXPECT_THAT(outcome.error, HasSubstr("determined is D_SS" + gyro + " - D_OO" + gyro + ","));
    }
    // AND the four of each gyro that cannot be told apart are null
    const Json result = Json::parse(outcome.out);
    const std::set<std::string> together{"D_F", "D_II", "D_OO", "D_SS"};
    for (const Json& parameter : result["parameters"]) {
        const std::string name = parameter["name"];
        const bool open = together.count(name.substr(0, name.size() - 1)) == 1;
        EXPECT_EQ(parameter["observable"], !open) << name;
        EXPECT_EQ(parameter["value"].is_null(), open) << name;
        EXPECT_EQ(parameter["sigma"].is_null(), open) << name;
    }
    // and their determined combinations agree with Table 2 of Tang et al. 2009: three for each gyro
    EXPECT_EQ(result["combinations"].size(), 9U);
    for (const Json& combination : result["combinations"]) {
        EXPECT_TRUE(combination["value"].is_number());
        EXPECT_GT(combination["sigma"].get<double>(), 0);
        EXPECT_GT(combination["u"].get<double>(), combination["sigma"].get<double>());
        EXPECT_EQ(combination["weights"].size(), 2U);
    }
    const Json& first = result["combinations"][0];
    const double kappa = first["weights"]["D_OOx"];
    EXPECT_EQ(first["weights"]["D_Fx"], 1.0);
    EXPECT_NEAR(kappa, 19.0, 0.1);
    EXPECT_NEAR(first["value"].get<double>(), 1 + 0.03 * kappa, 5 * first["sigma"].get<double>());
    // and people get it in words
    const Outcome table = vibrig("identify rec.csv");
    EXPECT_EQ(table.exit_code, 1);
    EXPECT_THAT(table.out, AllOf(HasSubstr("Not observable one by one"), HasSubstr("D_Fx + "),
                                 HasSubstr(" D_OOx = "), Not(HasSubstr("nan"))));
}

TEST_F(Identify, FromTwoRowsIsHonest) {
    write("rec.csv", kHeader + "0,1,1,0,0,0,0,1,0\n0.025,1,1,0,0,0,0,1,0\n");
    const Outcome outcome = vibrig("identify rec.csv --json");
    EXPECT_EQ(outcome.exit_code, 1) << outcome.error;
    const Json result = Json::parse(outcome.out);
    for (const Json& parameter : result["parameters"]) {
        EXPECT_EQ(parameter["observable"], false) << parameter;
        EXPECT_TRUE(parameter["value"].is_null()) << parameter;
    }
    EXPECT_EQ(vibrig("identify rec.csv").exit_code, 1);
}

#ifndef VIBRIG_SANITIZED  // instrumented code keeps what was freed
TEST_F(Identify, TakesNoMoreMemoryForALongerRecording) {
    // GIVEN recordings of 56 000 and 560 000 rows
    const auto memory_mb = [this](const std::string& dwell_s) {
        record("--dwell " + dwell_s);
        const std::string path = folder_ / "rec.csv";
        const pid_t child = ::fork();
        if (child == 0) {
            static_cast<void>(::freopen("/dev/null", "w", stdout));
            ::execl(VIBRIG, VIBRIG, "identify", path.c_str(), "--json", nullptr);
            ::_exit(127);
        }
        int status = 0;
        rusage used{};
        EXPECT_EQ(::wait4(child, &status, 0, &used), child);
        EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) <= 1) << status;
        return static_cast<double>(used.ru_maxrss) / 1024;
    };
    const double small = memory_mb("50"), large = memory_mb("500");
    // THEN the larger one needs 2 MB more at most, where a row alone has 88 bytes: 44 MB in all
    EXPECT_LT(large, small + 2) << small << " MB of the small one";
    EXPECT_LT(large, 100);
}
#endif

TEST_F(Identify, KnowsAClockThatGoesOnFromOneThatBeginsAnewInEachDwell) {
    // GIVEN a rig whose bias walks, which shows over the campaign
    record("--dwell 1 --write-truth truth.json");
    Json truth = Json::parse(content_of(folder_ / "truth.json"));
    truth["drift"]["bias_walk_deg_h_rt_h"] = 0.3;
    write("truth.json", truth.dump());
    record("--dwell 20 --truth truth.json");
    const Json together = Json::parse(vibrig("identify rec.csv --json").out);
    // WHEN the times of the same rows begin at 0 in each dwell
    std::istringstream rows(content_of(folder_ / "rec.csv"));
    std::string line, pair, text;
    std::getline(rows, line);
    text = line + "\n";
    double begin_s = 0;
    while (std::getline(rows, line)) {
        const auto comma = line.find(',');
        const std::string now =
            line.substr(comma, line.find(',', line.find(',', comma + 1) + 1) - comma);
        if (now != pair) begin_s = std::stod(line);
        pair = now;
        text += std::to_string(std::stod(line) - begin_s) + line.substr(comma) + "\n";
    }
    write("rec.csv", text);
    const Json apart = Json::parse(vibrig("identify rec.csv --json").out);
    // THEN the coefficients of a constant bias are the same, and those of one that walks are not
    const auto first = [](const Json& result, const char* key) {
        return result["parameters"][0][key].get<double>();
    };
    EXPECT_NEAR(first(together, "value_constant"), first(apart, "value_constant"), 1e-6);
    EXPECT_GT(std::abs(first(together, "value") - first(apart, "value")), 1e-3);
}

TEST_F(Identify, UsesTheConfiguration) {
    // GIVEN an outer encoder that counts the other way
    record("--dwell 4 --table-g 9");
    write("rig.toml", "[platform]\nencoder_sign = [-1, 1, 1]\n");
    // THEN the result is another one
    const Outcome plain = vibrig("identify rec.csv --json");
    const Outcome turned = vibrig("identify rec.csv --config rig.toml --json");
    EXPECT_NE(plain.out, turned.out);
}

TEST_F(Identify, RefusesBadRecordingsByRowAndColumn) {
    const std::string good = "0,1,1,0,0,0,0,1,0\n";
    const auto refused = [this](const std::string& text) {
        write("rec.csv", text);
        const Outcome outcome = vibrig("identify rec.csv --json");
        EXPECT_EQ(outcome.exit_code, 2) << text;
        EXPECT_EQ(outcome.out, "") << "no result from bad input";
        return outcome.error;
    };
    EXPECT_THAT(refused(kHeader + good + "0.025,1,1,nan,0,0,0,1,0\n"),
                AllOf(HasSubstr("rec.csv:3"), HasSubstr("alpha_deg"), HasSubstr("nan")));
    EXPECT_THAT(refused(kHeader + good + "-1,1,1,0,0,0,0,1,0\n"),
                AllOf(HasSubstr("rec.csv:3"), HasSubstr("time_s")));
    EXPECT_THAT(refused(kHeader + good + "0.025,1,1,0,0\n"), HasSubstr("rec.csv:3"));
    EXPECT_THAT(refused(kHeader + good + "0.025,one,1,0,0,0,0,1,0\n"),
                AllOf(HasSubstr("rec.csv:3"), HasSubstr("run"), HasSubstr("one")));
    EXPECT_THAT(refused("time_s,run,position,alpha_deg,beta_deg,gamma_deg,ax_g,ay_g\n" + good),
                HasSubstr("az_g"));
    EXPECT_THAT(refused(""), HasSubstr("rec.csv"));
    EXPECT_THAT(refused(kHeader), HasSubstr("rec.csv"));
}

TEST_F(Identify, RefusesBadConfigurationsAndUsage) {
    write("rec.csv", kHeader + "0,1,1,0,0,0,0,1,0\n");
    write("rig.toml", "[vibration]\nfrequenzy_hz = 15\n");
    Outcome outcome = vibrig("identify rec.csv --config rig.toml");
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.error, AllOf(HasSubstr("rig.toml:2:1: vibration.frequenzy_hz: found"),
                                     HasSubstr("perhaps vibration.frequency_hz")));
    outcome = vibrig("identify rec.csv --config none.toml");
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.error, HasSubstr("none.toml"));
    outcome = vibrig("identify none.csv");
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.error, HasSubstr("none.csv"));
    EXPECT_EQ(vibrig("identify").exit_code, 2);
    EXPECT_EQ(vibrig("identify rec.csv --jsn").exit_code, 2);
    EXPECT_EQ(vibrig("").exit_code, 2);
    EXPECT_EQ(vibrig("identify rec.csv --json >/dev/full").exit_code, 2) << "a full disk";
}

TEST_F(Identify, TheSimulatedRigRefusesWhatIsNoNumber) {
    const auto refusal_of = [&](const std::string& arguments) {
        const Outcome outcome = run(VIBRIG_PLANT, arguments);
        EXPECT_EQ(outcome.exit_code, 2) << arguments;
        EXPECT_EQ(outcome.out, "") << arguments;
        return outcome.error;
    };
    for (const char* option : {"--table-g", "--frequency", "--dwell", "--ramp", "--settle"}) {
        for (const char* value : {"nan", "inf", "-1"}) {
            EXPECT_THAT(
                refusal_of(std::string("record -o - ") + option + "=" + value),
                HasSubstr(std::string(option) + ": found " + value + ", expected a finite number"));
        }
    }
    EXPECT_THAT(refusal_of("record -o - --table-g 9,nan"), HasSubstr("--table-g: found nan"));
    for (const char* option : {"--warm-up", "--start-temperature", "--duration"}) {
        EXPECT_THAT(refusal_of(std::string("run --modbus none ") + option + "=nan"),
                    HasSubstr(std::string(option) + ": found nan, expected a finite number"));
    }
    EXPECT_THAT(refusal_of("judge none.json --sigma nan"), HasSubstr("--sigma: found nan"));
    for (const char* value : {"-1", "1.5", "x", "18446744073709551616"}) {
        const std::string seed = std::string(" --seed=") + value;
        const std::string text =
            std::string("--seed: found ") + value + ", expected a whole number";
        EXPECT_THAT(refusal_of("record -o -" + seed), HasSubstr(text));
        EXPECT_THAT(refusal_of("run --modbus none" + seed), HasSubstr(text));
        for (const char* command : {"zero simulate", "level simulate", "plan"}) {
            const Outcome outcome = vibrig(command + seed);
            EXPECT_EQ(outcome.exit_code, 2) << command << seed;
            EXPECT_THAT(outcome.error, HasSubstr(text));
        }
    }
}

TEST_F(Identify, NoCommandTakesWhatIsNoNumber) {
    write("empty.log", "");
    for (const char* command :
         {"commission bus --candump empty.log --for",
          "commission bus --candump empty.log --turn-at",
          "commission units --by Ada --display 'g peak' --reference", "trend 17 --shutdown-after",
          "trend 17 --at-hz", "archive type GP-3 --at-hz", "study run none --chunk",
          "predict none.json --profile truck --seconds"}) {
        const Outcome outcome = vibrig(std::string(command) + " nan");
        EXPECT_EQ(outcome.exit_code, 2) << command;
        EXPECT_THAT(outcome.error, HasSubstr(": found nan, expected a finite number")) << command;
    }
}

TEST_F(Identify, EveryCommandHasHelpWithAnExample) {
    const Outcome help = vibrig("identify --help");
    EXPECT_EQ(help.exit_code, 0);
    EXPECT_THAT(help.out, HasSubstr("Example: vibrig identify"));
    EXPECT_EQ(vibrig("--help").exit_code, 0);
    EXPECT_THAT(vibrig("--version").out, HasSubstr("vibrig "));
}

TEST_F(Identify, AWordThatIsNoCommandIsNamed) {
    const Outcome outcome = vibrig("frobnicate");
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.error, HasSubstr("found \"frobnicate\", expected a command"));
}

}  // namespace
