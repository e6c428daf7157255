#include "estimator/filter/product.hpp"

#include <gtest/gtest.h>

#include <random>

#include "tests/unit/estimator/filter/bits.hpp"

namespace vibrig::estimator::testing {
namespace {

TEST(SameBits, AProductIsThatOfEigenButForRounding) {
    std::mt19937_64 random(4);
    for (int i = 0; i < 100; ++i) {
        Eigen::Matrix3d a, b;
        fill(a, random);
        fill(b, random);
        EXPECT_LT((product(a, b) - a * b).cwiseAbs().maxCoeff(), 1e-14);
    }
}

}  // namespace
}  // namespace vibrig::estimator::testing
