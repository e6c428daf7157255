#pragma once

#include <cstddef>
#include <cstring>
#include <random>

namespace vibrig::estimator::testing {

template <typename Array>
void fill(Array& array, std::mt19937_64& random) {
    std::normal_distribution<double> normal;
    auto* const at = reinterpret_cast<double*>(&array);
    for (std::size_t i = 0; i < sizeof array / sizeof(double); ++i) at[i] = normal(random);
}

/// Of arrays of numbers: there is no padding in them.
template <typename Array>
bool same(const Array& a, const Array& b) {
    return std::memcmp(&a, &b, sizeof a) == 0;
}

}  // namespace vibrig::estimator::testing
