#pragma once

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "daemon/plan/plan_file.hpp"

namespace vibrig::plan::testing {

using SurveyJson = nlohmann::json;

/// Runs the real program in a folder of its own.
class SurveyCommand : public ::testing::Test {
  protected:
    SurveyCommand() {
        std::string name = (std::filesystem::temp_directory_path() / "vibrig-XXXXXX").string();
        folder_ = mkdtemp(name.data());
    }
    ~SurveyCommand() override { std::filesystem::remove_all(folder_); }

    int vibrig(const std::string& arguments) {
        const std::string command =
            "cd '" + folder_.string() + "' && '" VIBRIG "' >out 2>error </dev/null " + arguments;
        const int status = std::system(command.c_str());
        out = text_of("out");
        error = text_of("error");
        return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    }
    SurveyJson json() const { return SurveyJson::parse(out); }
    std::string path(const std::string& name) const { return (folder_ / name).string(); }
    void write(const std::string& name, const std::string& text) const {
        std::ofstream(folder_ / name, std::ios::binary) << text;
    }
    std::string text_of(const std::string& name) const {
        std::ostringstream text;
        text << std::ifstream(folder_ / name, std::ios::binary).rdbuf();
        return text.str();
    }
    bool refuses(const std::string& plan, const std::string& words) {
        write("bad.json", plan);
        try {
            static_cast<void>(read_plan(path("bad.json"), 1));
        } catch (const PlanFileError& refusal) {
            error = refusal.what();
            return error.find(words) != std::string::npos;
        }
        return false;
    }

    std::filesystem::path folder_;
    std::string out;
    std::string error;
};

}  // namespace vibrig::plan::testing
