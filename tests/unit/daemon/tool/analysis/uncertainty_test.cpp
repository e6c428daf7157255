#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/unit/support/vibrig_command.hpp"

namespace {

class UncertaintyCommand : public vibrig::test::VibrigCommand {};

TEST_F(UncertaintyCommand, OneCoefficientIsOneInJsonToo) {
    // GIVEN a recording of the simulated rig
    const std::string record = "cd '" + folder_.string() +
                               "' && '" VIBRIG_PLANT
                               "' record --seed 11 --dwell 10 -o rec.csv >out 2>error";
    ASSERT_EQ(std::system(record.c_str()), 0) << content("error");
    const auto json = [&](const std::string& options) {
        EXPECT_NE(vibrig("uncertainty rec.csv --json" + options), 2) << error;
        return nlohmann::json::parse(out, nullptr, false);
    };
    // WHEN all are asked for THEN all are there, WHEN one is THEN that one, the same
    const auto all = json("")["coefficients"];
    ASSERT_EQ(all.size(), 30U);
    const auto one = json(" --coefficient D_IIx")["coefficients"];
    ASSERT_EQ(one.size(), 1U);
    EXPECT_EQ(one[0]["name"], "D_IIx");
    EXPECT_NE(std::find(all.begin(), all.end(), one[0]), all.end()) << one[0];
    expect_refusal("uncertainty rec.csv --coefficient D9", "--coefficient: found 'D9'");
}

}  // namespace
