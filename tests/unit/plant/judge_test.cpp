#include "tests/plant/judge.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace vibrig::plant {
namespace {

nlohmann::json perfect() {
    nlohmann::json root;
    const Truth truth;
    for (std::size_t gyro = 0; gyro < 3; ++gyro) {
        for (std::size_t term = 0; term < kTerms; ++term) {
            root["parameters"].push_back({{"name", coefficient_name(gyro, term)},
                                          {"value", truth.coefficients[gyro][term] + 0.001},
                                          {"sigma", 0.001},
                                          {"unit", coefficient_unit(term)},
                                          {"observable", true}});
        }
    }
    return root;
}
Verdict judged(const nlohmann::json& root, double sigma = 4) {
    return judge(root.dump(), "result.json", Truth{}, sigma);
}

TEST(Judge, PassesThirtyGoodCoefficients) {
    const Verdict verdict = judged(perfect());
    EXPECT_TRUE(verdict.passed);
    ASSERT_EQ(verdict.coefficients.size(), 30U);
    EXPECT_NEAR(verdict.coefficients[7].ratio, 1, 1e-9);
    EXPECT_NE(table_of(verdict).find("all 30 within"), std::string::npos);
}

TEST(Judge, FailsWhatIsFarMissingNullOrUnobservable) {
    const auto fails = [](const char* what, auto change) {
        nlohmann::json root = perfect();
        change(root["parameters"]);
        const Verdict verdict = judged(root);
        EXPECT_FALSE(verdict.passed) << what;
        EXPECT_FALSE(verdict.coefficients[verdict.worst].fault.empty()) << what;
    };
    fails("far", [](nlohmann::json& p) { p[3]["value"] = p[3]["value"].get<double>() + 0.0041; });
    fails("missing", [](nlohmann::json& p) { p.erase(4); });
    fails("null value", [](nlohmann::json& p) { p[5]["value"] = nullptr; });
    fails("null sigma", [](nlohmann::json& p) { p[5]["sigma"] = nullptr; });
    fails("zero sigma", [](nlohmann::json& p) { p[5]["sigma"] = 0; });
    fails("empty", [](nlohmann::json& p) { p = nlohmann::json::array(); });
    nlohmann::json root = perfect();
    root["parameters"][9]["observable"] = false;
    EXPECT_FALSE(judged(root).passed);
    root = perfect();
    root["parameters"][9]["unit"] = "deg/s";
    EXPECT_FALSE(judged(root).passed);
    EXPECT_FALSE(judged(perfect(), 0.5).passed);
}

TEST(Judge, SaysTheSameInJson) {
    // GIVEN a result with one that is wrong and one that is not there
    nlohmann::json root = perfect();
    root["parameters"][3]["value"] = root["parameters"][3]["value"].get<double>() + 0.0041;
    root["parameters"].erase(4);
    const Verdict verdict = judged(root);
    const auto json = nlohmann::json::parse(json_of(verdict));
    // THEN all 30 are there, each as the table has it, and what is missing is null
    EXPECT_EQ(json["passed"], false);
    EXPECT_EQ(json["worst"], verdict.coefficients[4].name);
    ASSERT_EQ(json["coefficients"].size(), 30U);
    for (std::size_t i = 0; i < 30; ++i) {
        EXPECT_EQ(json["coefficients"][i]["name"], verdict.coefficients[i].name);
        EXPECT_EQ(json["coefficients"][i]["truth"], verdict.coefficients[i].truth);
        EXPECT_EQ(json["coefficients"][i]["fault"], i == 3   ? "too far off"
                                                    : i == 4 ? "missing"
                                                             : "");
    }
    EXPECT_NEAR(json["coefficients"][3]["error_over_sigma"].get<double>(),
                verdict.coefficients[3].ratio, 1e-12);
    EXPECT_TRUE(json["coefficients"][4]["estimate"].is_null());
    EXPECT_EQ(nlohmann::json::parse(json_of(judged(perfect())))["passed"], true);
}

TEST(Judge, NamesAFileThatIsNoJsonAndItsPlace) {
    const auto complaint = [](const std::string& text) {
        try {
            static_cast<void>(judge(text, "result.json", Truth{}, 4));
        } catch (const PlantError& error) {
            return std::string(error.what());
        }
        return std::string();
    };
    EXPECT_EQ(complaint("{\n \"parameters\": nothing}"),
              "result.json: not JSON, expected an identification result; line 2, column 17");
    EXPECT_EQ(
        complaint(""),
        "result.json: not JSON, expected an identification result; line 1, column 1: the text "
        "ends");
}

TEST(Judge, TakesTheDeviationThatBelongsToTheValue) {
    // GIVEN a result with a budget, whose sigma belongs to value_constant
    nlohmann::json root = perfect();
    for (auto& parameter : root["parameters"]) {
        parameter["value"] = parameter["value"].get<double>() + 0.005;
        parameter["u_a"] = 0.002;
        parameter["u"] = 0.5;  // with room for errors that nobody gave the rig
    }
    // THEN each is 3 u_a off, not 6 sigma, nor nothing of u
    EXPECT_TRUE(judged(root).passed);
    EXPECT_NEAR(judged(root).coefficients[7].ratio, 3, 1e-9);
    EXPECT_FALSE(judged(root, 2.9).passed);
    // AND one without a budget is judged by sigma
    root["parameters"][7]["u_a"] = nullptr;
    EXPECT_FALSE(judged(root).passed);
}

TEST(Judge, RefusesWhatIsNoResult) {
    for (const char* text :
         {"", "{", "[]", "{}", R"({"parameters": 3})", R"({"parameters": [{"value": 1}]})"}) {
        EXPECT_THROW(static_cast<void>(judge(text, "result.json", Truth{}, 4)), PlantError) << text;
    }
    nlohmann::json root = perfect();
    root["parameters"].push_back(root["parameters"][0]);
    EXPECT_THROW(static_cast<void>(judged(root)), PlantError);
}

}  // namespace
}  // namespace vibrig::plant
