#pragma once

#include <cmath>
#include <random>

#include "estimator/filter/angles.hpp"

namespace vibrig::estimator::testing {

inline constexpr double kLevelPeriod_s = 0.025;

/// K (1 + a (sin(wt + p) + e sin(2wt + p2))) + noise at 40 Hz.
struct Signal {
    double amplitude = 6, frequency = 15, harmonic = 0.05, noise = 1e-4, gain = 1, phase = 0,
           phase2 = 0;

    [[nodiscard]] double kappa() const {
        return 1 + 0.5 * amplitude * amplitude * (1 + harmonic * harmonic);
    }
    template <class Random>
    double at(double t, Random& random) const {
        std::normal_distribution<double> gauss(0, noise);
        const double wt = 2 * kPi * frequency * t;
        return gain *
                   (1 + amplitude * (std::sin(wt + phase) + harmonic * std::sin(2 * wt + phase2))) +
               gauss(random);
    }
};

}  // namespace vibrig::estimator::testing
