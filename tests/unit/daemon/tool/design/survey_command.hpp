#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "daemon/plan/plan_file.hpp"
#include "tests/unit/support/vibrig_command.hpp"

namespace vibrig::plan::testing {

using SurveyJson = nlohmann::json;

/// The platform shakes as the table does.
inline std::optional<double> as_the_table(std::optional<double> /*hz*/) { return 1; }

class SurveyCommand : public test::VibrigCommand {
  protected:
    SurveyJson json() const { return SurveyJson::parse(out); }
    std::string path(const std::string& name) const { return (folder_ / name).string(); }
    bool refuses(const std::string& plan, const std::string& words) {
        write("bad.json", plan);
        try {
            refuse_random(read_plan_file(path("bad.json"), as_the_table).runs);
        } catch (const PlanFileError& refusal) {
            error = refusal.what();
            return error.find(words) != std::string::npos;
        }
        return false;
    }
};

}  // namespace vibrig::plan::testing
