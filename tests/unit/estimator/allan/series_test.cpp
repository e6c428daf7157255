#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "estimator/allan/deviation.hpp"
#include "tests/unit/estimator/allan/support.hpp"

namespace {

using namespace vibrig::estimator::allan;
using vibrig::test::kNaN;
using vibrig::test::white;

TEST(Data, UnusableRecordsAreRefusedWithNumbers) {
    const auto why = [](const std::vector<double>& rate) -> std::string {
        try {
            require_usable(Series::from_rate(rate, 1.0), inspect(rate), rate.empty() ? 0 : rate[0]);
        } catch (const DataError& error) {
            return error.what();
        }
        return "";
    };
    EXPECT_NE(why({}).find("0 present"), std::string::npos);
    EXPECT_NE(why({1, 2, 3}).find("3 present, at least 9"), std::string::npos);
    EXPECT_NE(why(std::vector<double>(20, 0.25)).find("all 20 samples are 0.25"),
              std::string::npos);
    std::vector<double> holes = white(20, 1, 1);
    holes[3] = holes[4] = holes[9] = kNaN;
    EXPECT_NE(why(holes).find("3 of 20 (longest gap 2)"), std::string::npos);
    EXPECT_EQ(why(white(20, 1, 1)), "");
}

TEST(Data, OutliersAreCountedAndTheLsbIsFound) {
    std::vector<double> rate = white(1000, 1.0, 8);
    for (double& y : rate) {
        y = std::round(y * 4) / 4;
    }
    rate[321] = 500;
    rate[400] = -500;
    const Inspection found = inspect(rate);
    EXPECT_EQ(found.outliers, 2U);
    EXPECT_EQ(found.first_outlier, 321U);
    EXPECT_DOUBLE_EQ(found.lsb, 0.25);
}

}  // namespace
