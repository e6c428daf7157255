#include "estimator/uncertainty/distributions.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace vibrig::estimator::uncertainty {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();

// Printed tables (Abramowitz and Stegun 26.7 to 26.10; JCGM 100, table G.2).
TEST(Distributions, AgreeWithPrintedTables) {
    EXPECT_NEAR(chi_square_tail(3.84146, 1), 0.05, 1e-6);
    EXPECT_NEAR(chi_square_tail(18.3070, 10), 0.05, 1e-6);
    EXPECT_NEAR(chi_square_tail(149.449, 100), 0.001, 1e-6);
    EXPECT_NEAR(chi_square_tail(2.15585, 10), 0.995, 1e-6);
    EXPECT_EQ(chi_square_tail(0, 5), 1);
    EXPECT_NEAR(f_tail(4.9646, 1, 10), 0.05, 1e-5);
    EXPECT_NEAR(f_tail(2.9782, 10, 10), 0.05, 1e-5);
    EXPECT_NEAR(f_tail(1.8307, 10, kInfinite), 0.05, 1e-5);
    EXPECT_NEAR(student_quantile(0.95, 1), 12.7062, 1e-4);
    EXPECT_NEAR(student_quantile(0.95, 10), 2.2281, 1e-4);
    EXPECT_NEAR(student_quantile(0.95, 18), 2.1009, 1e-4);
    EXPECT_NEAR(student_quantile(0.95, kInfinite), 1.95996, 1e-5);
}

}  // namespace
}  // namespace vibrig::estimator::uncertainty
