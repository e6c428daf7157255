#include "daemon/results/result_difference.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace vibrig::tool {
namespace {

using Json = nlohmann::ordered_json;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

Json result() {
    return Json::parse(R"({
        "parameters": [
            {"name": "D_Fx", "value": 0.999, "u": 0.01, "expanded": 0.02, "unit": "deg/h"},
            {"name": "D_Ix", "value": -1.0, "u": 0.01, "expanded": 0.02, "unit": "deg/h/g"}],
        "warnings": [],
        "verdict": {"word": "valid", "reasons": []},
        "dwell_rates": [{"level": 0.0}],
        "compiler": "g++", "simulated": false})");
}

TEST(ResultDifference, NamesTheFirstThingThatIsAnother) {
    const std::string replayed = result().dump();
    const auto after = [&replayed](const auto& change) {
        Json recorded = result();
        change(recorded);
        return result_difference(recorded.dump(), replayed);
    };
    EXPECT_THAT(after([](Json&) {}), IsEmpty());
    EXPECT_EQ(after([](Json& r) { r["parameters"][0]["value"] = 0.599; }),
              "/result: parameters D_Fx value: found 0.599, the replay gives 0.999");
    for (const char* of : {"u", "expanded"})
        EXPECT_THAT(after([of](Json& r) { r["parameters"][1][of] = 1e-3; }),
                    HasSubstr("parameters D_Ix " + std::string(of) + ": found 0.001"));
    EXPECT_THAT(after([](Json& r) { r["parameters"][1]["name"] = "D_Fx"; }),
                HasSubstr("parameters D_Ix name: found \"D_Fx\""));
    EXPECT_THAT(after([](Json& r) { r["parameters"][0]["unit"] = "<script>"; }),
                HasSubstr("parameters D_Fx unit: found \"<script>\""));
    EXPECT_THAT(after([](Json& r) { r["verdict"]["word"] = "doubtful"; }),
                HasSubstr("verdict word: found \"doubtful\", the replay gives \"valid\""));
    EXPECT_THAT(after([](Json& r) { r["parameters"][0]["note"] = 1; }), HasSubstr("D_Fx"));
    EXPECT_THAT(after([](Json& r) { r["spectrum"] = 1; }), HasSubstr("found spectrum in it"));
}

TEST(ResultDifference, WhatIsNotOfTheNumbersDoesNotCount) {
    Json recorded = result();
    recorded["warnings"] = {"campaign marked: bumped"};
    recorded["compiler"] = "clang++";
    recorded["type_prior"] = {{"type", "GP-3"}};
    // Results of earlier versions have no rates of the dwells.
    recorded.erase("dwell_rates");
    EXPECT_THAT(result_difference(recorded.dump(), result().dump()), IsEmpty());
}

TEST(ResultDifference, WhateverItIsOfItIsSaid) {
    const std::string replayed = result().dump();
    for (const char* text : {"", "{", "[1,2]", "5", "null"})
        EXPECT_THAT(result_difference(text, replayed), HasSubstr("found no JSON object")) << text;
    for (const char* key : {"parameters", "verdict"}) {
        Json recorded = result();
        recorded[key] = 5;
        EXPECT_THAT(result_difference(recorded.dump(), replayed),
                    HasSubstr(std::string("/result: ") + key + ": found 5"));
        recorded[key] = Json::array({5});
        EXPECT_THAT(result_difference(recorded.dump(), replayed), HasSubstr(": found [5]"));
        recorded.erase(key);
        EXPECT_THAT(result_difference(recorded.dump(), replayed),
                    HasSubstr("found no " + std::string(key)));
    }
}

}  // namespace
}  // namespace vibrig::tool
