#include "daemon/results/result_table.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vibrig::tool {
namespace {

using ::testing::HasSubstr;

/// The row of one run that has this kappa and this frequency.
std::string row_of(double kappa, double frequency_hz) {
    estimator::Result result;
    result.amplitudes.push_back({7, 1.5, kappa, 1e-5, frequency_hz});
    const std::string table = result_table(result, {});
    const std::size_t begin = table.find("\n7  ") + 1;
    return table.substr(begin, table.find('\n', begin) - begin);
}

TEST(ResultTable, OnlyATableThatDoesNotVibrateIsAtRest) {
    EXPECT_THAT(row_of(1, 0), HasSubstr(" at rest"));
    // Of the noise eq. 13 makes a little amplitude, at rest, too.
    EXPECT_THAT(row_of(1 + 1e-8, 0), HasSubstr(" at rest"));
    EXPECT_THAT(row_of(19, 15.00012), HasSubstr(" 15.0001"));
    // 6 g somewhere else than where they were looked for
    EXPECT_THAT(row_of(19, 0), HasSubstr(" no line"));
}

TEST(ResultTable, ACombinationHasTheUncertaintyOfTheAssessment) {
    estimator::Result result;
    result.combinations.push_back({{{"D_Fx", 1}, {"D_OOx", 19}}, 1.57, 0.004});
    EXPECT_THAT(result_table(result, {}),
                HasSubstr("D_Fx + 19 D_OOx = 1.570000, sigma 0.004000 deg/h"));
    estimator::uncertainty::Assessment assessed;
    assessed.combinations.push_back({1.6, 0.02});
    EXPECT_THAT(result_table(result, assessed),
                HasSubstr("D_Fx + 19 D_OOx = 1.600000, u 0.020000, sigma 0.004000 deg/h"));
}

}  // namespace
}  // namespace vibrig::tool
