#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::tool {

using PredictJson = nlohmann::json;

struct Ended {
    int exit_code = -1;
    std::string out, error;
    [[nodiscard]] PredictJson json() const { return PredictJson::parse(out); }
};

/// The real programs over a survey of a rig that is half elastic, 40 s a dwell, made once.
class Predict : public ::testing::Test {
  protected:
    static void SetUpTestSuite() {
        made().emplace();
        write("truth.json", "{}");
        ASSERT_EQ(plant("--dwell 1 --write-truth truth.json --table-g 6 -o x.csv").exit_code, 0);
        std::ifstream in(folder() / "truth.json");
        PredictJson truth = PredictJson::parse(in);
        truth["isolator"]["hard"] = true;
        truth["elastic"]["share"] = {0.5, 0.5, 0.5};
        write("truth.json", truth.dump());
        ASSERT_EQ(plant("--truth truth.json --seed 5 --dwell 40" + std::string(kSurvey) +
                        " --order " + survey_order() + " -o survey.csv")
                      .exit_code,
                  0);
        const Ended found = run("identify survey.csv --json");
        ASSERT_EQ(found.exit_code, 0) << found.error << found.out.substr(0, 2000);
        write("result.json", found.out);
        // Held-out dwells at 55 Hz, at positions of their own.
        write("held.csv", "alpha_deg,beta_deg,gamma_deg\n30,10,-20\n-50,0,70\n100,15,30\n");
        ASSERT_EQ(plant("--truth truth.json --seed 6 --dwell 40 --table-g 3 --frequency 55 "
                        "--positions held.csv -o held_out.csv")
                      .exit_code,
                  0);
        write("held.toml", "[vibration]\nfrequency_hz = 55.0\n");
        write("sine.json", R"({"name": "55 Hz", "sines": [[55, 3]]})");
    }
    static void TearDownTestSuite() { made().reset(); }

    static constexpr const char* kSurvey =
        " --table-g 6,0,6,6,6,6,6,6 --frequency 15,15,25,35,45,65,85,125";
    /// Balanced over time by a step of 26 through the 63, which have no common factor.
    static std::string survey_order() {
        std::vector<std::string> dwells;
        const auto add = [&](int position, int run) {
            dwells.push_back(std::to_string(position) + "." + std::to_string(run));
        };
        for (int p = 1; p <= 14; ++p) add(p, 1);
        for (int p = 1; p <= 13; p += 2) add(p, 2);
        for (int run = 3; run <= 8; ++run) {
            for (const int p : {4, 5, 6, 7, 10, 13, 14}) add(p, run);
        }
        std::string order;
        for (std::size_t i = 0; i < dwells.size(); ++i)
            order += (i > 0 ? "," : "") + dwells[i * 26 % dwells.size()];
        return order;
    }
    static const std::filesystem::path& folder() { return *made(); }
    static std::optional<vibrig::TemporaryFolder>& made() {
        static std::optional<vibrig::TemporaryFolder> folder;
        return folder;
    }
    static std::string content(const char* name) {
        std::ostringstream text;
        text << std::ifstream(folder() / name, std::ios::binary).rdbuf();
        return text.str();
    }
    static Ended start(const std::string& program, const std::string& arguments) {
        const std::string command = "cd '" + folder().string() + "' && '" + program +
                                    "' >out 2>error </dev/null " + arguments;
        const int status = std::system(command.c_str());
        return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, content("out"), content("error")};
    }
    static Ended run(const std::string& arguments) { return start(VIBRIG, arguments); }
    static Ended plant(const std::string& arguments) {
        return start(VIBRIG_PLANT, "record " + arguments);
    }
    static void write(const std::string& name, const std::string& text) {
        std::ofstream(folder() / name, std::ios::binary) << text;
    }
    /// The same of run 1 at all fourteen positions.
    static std::string spectra_of(const std::string& lines) {
        std::string list;
        for (int p = 1; p <= 14; ++p)
            list += (p > 1 ? ", " : "") + (R"({"run": 1, "position": )" + std::to_string(p)) +
                    R"(, "lines": )" + lines + "}";
        return "[" + list + "]";
    }
    static PredictJson result() { return PredictJson::parse(content("result.json")); }
    static void write_without_elastic_part(const std::string& name,
                                           const char* of = "result.json") {
        PredictJson broken = PredictJson::parse(content(of));
        for (auto& gyro : broken["spectrum"]["mixture"]) {
            for (auto& one : gyro) {
                for (std::size_t i = 10; i < one["x"].size(); ++i) one["x"][i] = 0.0;
            }
        }
        write(name, broken.dump());
    }
};

}  // namespace vibrig::tool
