#include "daemon/serve/openapi.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "daemon/serve/status_json.hpp"
#include "tests/unit/daemon/serve/fake_source.hpp"

namespace vibrig::serve {
namespace {

TEST(OpenApi, IsOneJsonObject) {
    const auto tree = nlohmann::json::parse(openapi_json(), nullptr, false);
    ASSERT_TRUE(tree.is_object());
    EXPECT_TRUE(tree.contains("paths"));
}

/// What `schema` requires and `value` lacks, at whatever depth.
std::string lacking(const nlohmann::json& schemas, const nlohmann::json& schema,
                    const nlohmann::json& value) {
    if (schema.contains("$ref")) {
        const std::string name = schema["$ref"];
        return lacking(schemas, schemas.at(name.substr(name.rfind('/') + 1)), value);
    }
    std::string found;
    if (schema.value("type", nlohmann::json()) == "array") {
        for (const auto& item : value) found += lacking(schemas, schema["items"], item);
        return found;
    }
    if (!schema.contains("properties")) return {};
    for (const std::string name : schema["required"])
        if (!value.contains(name)) found += name + ' ';
    for (const auto& [name, part] : schema["properties"].items())
        if (value.contains(name)) found += lacking(schemas, part, value[name]);
    return found;
}

TEST(OpenApi, RequiresWhatIsAlwaysThere) {
    const auto schemas = nlohmann::json::parse(openapi_json())["components"]["schemas"];
    const auto judge = [&](const char* name, const std::string& text) {
        return lacking(schemas, schemas.at(name), nlohmann::json::parse(text));
    };
    // GIVEN answers with as little in them as can be, and full ones
    for (const StatusData& status : {StatusData{}, full_status()}) {
        EXPECT_EQ(judge("Status", status_json(status)), "");
        EXPECT_EQ(judge("Campaign", campaign_json(status)), "");
    }
    EXPECT_EQ(judge("Parameters", parameters_json(full_result(), full_status().verdict)), "");
    EXPECT_EQ(judge("Events", events_json("", {EventRecord{}})), "");
    EXPECT_EQ(judge("Plan", plan_json({})), "");
    EXPECT_EQ(judge("Surface", surface_json({})), "");
    EXPECT_EQ(judge("CommandReply", reply_json({})), "");
    EXPECT_EQ(judge("Configuration", configuration_json("")), "");
    EXPECT_EQ(judge("Problem", problem_json(400, "", "")), "");
    EXPECT_EQ(judge("Command", R"({"kind":"arm","by":"Ada"})"), "");
    // THEN they pass, and what says nothing does not
    for (const char* name : {"Status", "Campaign", "Parameters", "Events", "Plan", "CommandReply",
                             "Configuration", "Problem", "Readiness", "Command"})
        EXPECT_NE(judge(name, "{}"), "") << name;
    EXPECT_NE(judge("Status", "{}").find("campaign "), std::string::npos);
    EXPECT_NE(judge("Campaign", "{}").find("state "), std::string::npos);
    EXPECT_EQ(judge("Command", "{}"), "kind by ");
}

}  // namespace
}  // namespace vibrig::serve
