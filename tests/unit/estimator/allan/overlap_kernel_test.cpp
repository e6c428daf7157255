#include "estimator/allan/overlap_kernel.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/unit/estimator/allan/support.hpp"

namespace {

using namespace vibrig::estimator::allan;
using vibrig::test::white;

TEST(OverlapKernel, EqualsThePlainLoopForEveryLengthOfRemainder) {
    // GIVEN lengths around the block of 64 and factors that reach past the end
    for (const std::size_t points : {1U, 2U, 3U, 63U, 64U, 65U, 129U, 200U, 333U}) {
        const std::vector<double> x = white(points, 1.0, points);
        const std::vector<std::size_t> factors{1, 2, 31, 32, 64, 100, 400};
        std::vector<double> sums(factors.size(), 0.0);
        // WHEN
        add_overlapping_squares(x.data(), points, factors.data(), factors.size(), sums.data());
        // THEN
        for (std::size_t k = 0; k < factors.size(); ++k) {
            double expected = 0;
            for (std::size_t i = 0; i + 2 * factors[k] < points; ++i) {
                expected += std::pow(x[i + 2 * factors[k]] - 2 * x[i + factors[k]] + x[i], 2);
            }
            EXPECT_NEAR(sums[k], expected, 1e-12 * expected) << points << " " << factors[k];
        }
    }
}

}  // namespace
