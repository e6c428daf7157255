#include "estimator/uncertainty/rates_covariance.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <random>
#include <string>

namespace vibrig::estimator::uncertainty {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// The same by matrices of n x n.
TEST(RatesCovariance, IsThatOfTheDenseMatrices) {
    const std::uint64_t seed = 3;
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    constexpr Index n = 40;
    VectorXd noise(n), elapsed(n);
    MatrixXd columns(n, 2), x(n, 3);
    for (Index i = 0; i < n; ++i) {
        noise[i] = 0.5 + std::abs(normal(random));
        elapsed[i] = i == 0 ? 0 : elapsed[i - 1] + 0.01 + 0.02 * std::abs(normal(random));
        columns.row(i) << normal(random), 3 * normal(random);
        x.row(i) << 1, normal(random), normal(random);
    }
    for (const double walk : {0.0, 0.3, 100.0}) {
        const RatesCovariance fast = drifting(noise, elapsed, walk, columns);
        MatrixXd kernel(n, n);
        for (Index i = 0; i < n; ++i) {
            for (Index j = 0; j < n; ++j) kernel(i, j) = std::min(elapsed[i], elapsed[j]);
        }
        const MatrixXd centre = MatrixXd::Identity(n, n) - MatrixXd::Constant(n, n, 1.0 / n);
        MatrixXd dense = walk * centre * kernel * centre + columns * columns.transpose();
        dense.diagonal() += noise;
        const Eigen::LLT<MatrixXd> factor(dense);
        const MatrixXd expected = factor.solve(x);
        EXPECT_LT((fast.solve(x) - expected).norm(), 1e-9 * expected.norm()) << walk;
        EXPECT_LT((fast.square(x) - x.transpose() * expected).norm(), 1e-9 * expected.norm() * n)
            << walk;
        EXPECT_NEAR(fast.log_determinant(),
                    2 * MatrixXd(factor.matrixL()).diagonal().array().log().sum(), 1e-8)
            << walk;
    }
}

}  // namespace
}  // namespace vibrig::estimator::uncertainty
