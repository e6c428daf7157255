#include "daemon/results/result_json.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

namespace vibrig::tool {
namespace {

using Json = nlohmann::ordered_json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// clang 14 takes the constructor of a member's default value for granted and does not make it.
[[maybe_unused]] const Eigen::VectorXd kMakesIt;

estimator::Result complete() {
    estimator::Result result;
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        result.value[i] = 0.1 * static_cast<double>(i) - 1;
        result.sigma[i] = 0.003;
        result.observable[i] = true;
        result.covariance[i][i] = 9e-6;
    }
    result.amplitudes.push_back({1, 6.0003, 19.0018, 1e-5, 15.0001});
    result.amplitudes.push_back({2, 0, 1, 1e-5, 0});
    result.nis_per_dof = 1.01;
    result.samples = 112000;
    result.rejected = 3;
    return result;
}

std::vector<std::string> keys_of(const Json& object) {
    std::vector<std::string> keys;
    for (const auto& [key, value] : object.items()) {
        keys.push_back(key);
    }
    return keys;
}

TEST(ResultJson, HasTheKeysOfTheContractInOrder) {
    const Json root = Json::parse(result_json(complete()));
    EXPECT_THAT(keys_of(root), ElementsAre("parameters", "covariance", "amplitudes", "combinations",
                                           "nis", "samples", "rejected", "warnings", "cross_check",
                                           "instruction_set", "compiler", "simulated"));
    EXPECT_FALSE(root["simulated"].get<bool>());
    EXPECT_TRUE(Json::parse(result_json(complete(), {}, true))["simulated"].get<bool>());
    ASSERT_EQ(root["parameters"].size(), 30U);
    EXPECT_THAT(keys_of(root["parameters"][0]),
                ElementsAre("name", "value", "sigma", "unit", "observable"));
    EXPECT_THAT(keys_of(root["amplitudes"][0]),
                ElementsAre("run", "amplitude_g", "kappa", "sigma_g", "frequency_hz"));
}

TEST(ResultJson, SaysOfWhichCampaignAndUnitItIs) {
    const auto printed = [](const CampaignNames& names) {
        return Json::parse(result_json(complete(), {}, false, nullptr, nullptr, nullptr, nullptr,
                                       &names))["campaign"]
            .dump();
    };
    EXPECT_EQ(printed({"night", 1'772'352'000'999'999'999, "GP-3", "0017"}),
              R"({"name":"night","ended":"2026-03-01T08:00:00Z",)"
              R"("unit":{"type":"GP-3","serial":"0017"}})");
    EXPECT_EQ(printed({"night", 0, "", ""}),
              R"({"name":"night","ended":null,"unit":{"type":null,"serial":null}})");
}

TEST(ResultJson, NamesTheCoefficientsAsIeee517Does) {
    const Json root = Json::parse(result_json(complete()));
    std::vector<std::string> names;
    for (const Json& parameter : root["parameters"]) {
        names.push_back(parameter["name"]);
    }
    const std::vector<std::string> gyro{"D_F",  "D_I",  "D_O",  "D_S",  "D_II",
                                        "D_OO", "D_SS", "D_IO", "D_IS", "D_OS"};
    for (std::size_t i = 0; i < 30; ++i) {
        EXPECT_EQ(names[i], gyro[i % 10] + "xyz"[i / 10]);
    }
    EXPECT_EQ(root["parameters"][0]["unit"], "deg/h");
    EXPECT_EQ(root["parameters"][13]["unit"], "deg/h/g");
    EXPECT_EQ(root["parameters"][29]["unit"], "deg/h/g^2");
}

TEST(ResultJson, NumbersReadBackExactly) {
    const estimator::Result result = complete();
    const Json root = Json::parse(result_json(result));
    for (std::size_t i = 0; i < 30; ++i) {
        EXPECT_EQ(root["parameters"][i]["value"].get<double>(), result.value[i]);
        EXPECT_EQ(root["covariance"][i][i].get<double>(), 9e-6);
        EXPECT_EQ(root["covariance"][i].size(), 30U);
    }
    EXPECT_EQ(root["samples"], 112000);
    EXPECT_EQ(root["rejected"], 3);
    EXPECT_EQ(root["nis"], 1.01);
    EXPECT_EQ(root["amplitudes"][0]["kappa"], 19.0018);
    EXPECT_EQ(root["combinations"], Json::array()) << "an empty list, not null";
    EXPECT_EQ(root["warnings"], Json::array());
}

TEST(ResultJson, WhatIsNotObservableOrDoesNotExistIsNullAndNeverNaN) {
    // GIVEN D_Fx not observable (with a number left in it), no NIS, a run at rest
    estimator::Result result = complete();
    result.observable[0] = false;
    result.value[0] = 12345.0;
    result.covariance[0].fill(kNaN);
    result.nis_per_dof = kNaN;
    result.combinations.push_back({{{"D_Fx", 1}, {"D_OOx", 19}}, 1.57, 0.004});
    const std::string text = result_json(result);
    const Json root = Json::parse(text);
    // THEN these are null
    EXPECT_TRUE(root["parameters"][0]["value"].is_null());
    EXPECT_TRUE(root["parameters"][0]["sigma"].is_null());
    EXPECT_EQ(root["parameters"][0]["observable"], false);
    for (std::size_t i = 0; i < 30; ++i) {
        EXPECT_TRUE(root["covariance"][0][i].is_null());
        EXPECT_TRUE(root["covariance"][i][0].is_null()) << "the column too";
    }
    EXPECT_TRUE(root["nis"].is_null());
    EXPECT_TRUE(root["amplitudes"][1]["frequency_hz"].is_null());
    EXPECT_EQ(root["amplitudes"][1]["amplitude_g"], 0.0);
    EXPECT_THAT(text, Not(HasSubstr("nan")));
    // and the combination is there, weights in the order given
    EXPECT_EQ(root["combinations"][0].dump(),
              R"({"weights":{"D_Fx":1.0,"D_OOx":19.0},"value":1.57,"sigma":0.004})");
    // with an assessment its value and uncertainty beside the filter's noise
    estimator::uncertainty::Assessment assessed;
    assessed.combinations.push_back({1.6, 0.02});
    EXPECT_EQ(Json::parse(result_json(result, assessed))["combinations"][0].dump(),
              R"({"weights":{"D_Fx":1.0,"D_OOx":19.0},"value":1.6,"sigma":0.004,"u":0.02})");
    EXPECT_FALSE(all_observable(result));
    EXPECT_TRUE(all_observable(complete()));
}

TEST(ResultJson, AWarningWithBrokenTextDoesNotCostTheResult) {
    estimator::Result result = complete();
    result.warnings = {"run 1: \"quoted\"\n", "\xff\xfe"};
    const Json root = Json::parse(result_json(result));
    EXPECT_EQ(root["warnings"][0], "run 1: \"quoted\"\n");
    EXPECT_EQ(root["warnings"].size(), 2U);
}

}  // namespace
}  // namespace vibrig::tool
