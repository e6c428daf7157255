#include "estimator/level/hann.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "estimator/filter/angles.hpp"

namespace vibrig::estimator::testing {
namespace {

TEST(GrowingHann, IsExactForAnyLength) {
    std::mt19937_64 random(25);
    std::normal_distribution<double> gauss;
    for (std::size_t n : {1UL, 2UL, 7UL, 80UL, 2047UL, 2048UL, 2049UL, 40001UL, 123456UL}) {
        GrowingHann growing;
        std::vector<double> values(n);
        for (double& v : values) {
            v = 1 + gauss(random);
            growing.add(v);
        }
        long double w = 0, s = 0, q = 0;
        for (std::size_t i = 0; i < n; ++i) {
            const long double weight = std::pow(
                std::sin(static_cast<long double>(kPi) * (static_cast<long double>(i) + 0.5L) /
                         static_cast<long double>(n)),
                2);
            w += weight;
            s += weight * values[i];
            q += weight * values[i] * values[i];
        }
        EXPECT_NEAR(growing.means().mean, static_cast<double>(s / w), 1e-7) << n;
        EXPECT_NEAR(growing.means().mean_square, static_cast<double>(q / w), 1e-7) << n;
        const HannMeans direct = HannWindow(n).means(values.data(), n, 0, n);
        EXPECT_NEAR(direct.mean, static_cast<double>(s / w), 1e-10) << n;
    }
}

}  // namespace
}  // namespace vibrig::estimator::testing
