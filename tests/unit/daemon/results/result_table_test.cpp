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

}  // namespace
}  // namespace vibrig::tool
