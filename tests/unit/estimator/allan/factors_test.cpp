#include <gtest/gtest.h>

#include <array>
#include <vector>

#include "estimator/allan/deviation.hpp"
#include "tests/unit/estimator/allan/support.hpp"

namespace {

using namespace vibrig::estimator::allan;
using vibrig::test::kNaN;

TEST(Factors, ListsAreCheckedAgainstTheRecord) {
    EXPECT_EQ(octave_factors(9), (std::vector<std::size_t>{1, 2, 4, 8}));
    EXPECT_EQ(decade_factors(45), (std::vector<std::size_t>{1, 2, 4, 10, 20, 40}));
    EXPECT_EQ(all_factors(3), (std::vector<std::size_t>{1, 2, 3}));
    EXPECT_EQ(log_factors(1000, 4), (std::vector<std::size_t>{1, 10, 100, 1000}));
    EXPECT_EQ(log_factors(0, 4).size(), 0U);
    EXPECT_EQ(factors_of(std::array{0.1, 0.3}, 0.1, 5), (std::vector<std::size_t>{1, 3}));
    EXPECT_THROW(static_cast<void>(factors_of(std::array{0.25}, 0.1, 5)), DataError);
    EXPECT_THROW(static_cast<void>(factors_of(std::array{0.1, 0.3, 0.1}, 0.1, 5)), DataError);
    EXPECT_THROW(static_cast<void>(factors_of(std::array{0.6}, 0.1, 5)), DataError);
    EXPECT_THROW(static_cast<void>(factors_of(std::array{kNaN}, 0.1, 5)), DataError);
    EXPECT_THROW(static_cast<void>(factors_of(std::array{-0.1}, 0.1, 5)), DataError);
    EXPECT_THROW(static_cast<void>(statistic_named("avar")), DataError);
}

}  // namespace
