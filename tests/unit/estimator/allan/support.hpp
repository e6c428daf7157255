#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

namespace vibrig::test {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

inline std::vector<double> white(std::size_t n, double sigma, std::uint64_t seed) {
    std::mt19937_64 generator(seed);
    std::normal_distribution<double> normal(0, sigma);
    std::vector<double> values(n);
    for (double& value : values) {
        value = normal(generator);
    }
    return values;
}

/// The number of events of n that is exceeded with probability 1e-3 at most.
inline int binomial_limit(int n, double probability) {
    double term = std::pow(1 - probability, n);
    double sum = term;
    int k = 0;
    for (; k < n && sum < 1 - 1e-3; ++k) {
        term *= (n - k) / (k + 1.0) * probability / (1 - probability);
        sum += term;
    }
    return k;
}

}  // namespace vibrig::test
