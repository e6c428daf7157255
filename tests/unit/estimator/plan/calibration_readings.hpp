#pragma once

#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "estimator/plan/calibration.hpp"
#include "estimator/plan/positions.hpp"

namespace vibrig::estimator::plan {

inline constexpr Row kTruth{3e-3, 1.002, -4e-4, 2e-4, 5e-6, -2e-6, 1e-6, 3e-6, -1e-6, 2e-6};
inline constexpr double kSigma = 2e-6;

/// The model, written a second time.
inline double output_of(const Vec3& x) {
    const auto [d0, d1, d2, d3, d11, d22, d33, d12, d13, d23] = kTruth;
    return d0 + d1 * x[0] + d2 * x[1] + d3 * x[2] + d11 * x[0] * x[0] + d22 * x[1] * x[1] +
           d33 * x[2] * x[2] + d12 * x[0] * x[1] + d13 * x[0] * x[2] + d23 * x[1] * x[2];
}

/// The 26 directions on these spheres, each `times`, with noise and a cubic term of the input axis.
inline std::vector<Reading> readings(const std::vector<double>& spheres, int times,
                                     std::uint64_t seed, bool stated, double cubic = 0) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    std::vector<Reading> list;
    for (int k = 0; k < times; ++k) {
        for (const double radius : spheres) {
            for (Vec3 x : cube_directions()) {
                for (double& value : x) value *= radius;
                list.push_back({x,
                                output_of(x) + cubic * std::pow(x[0], 3) + kSigma * normal(random),
                                stated ? kSigma : 0});
            }
        }
    }
    return list;
}

}  // namespace vibrig::estimator::plan
