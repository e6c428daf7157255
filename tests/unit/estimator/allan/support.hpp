#pragma once

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

}  // namespace vibrig::test
