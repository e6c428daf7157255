#pragma once

#include "estimator/filter/settings.hpp"

namespace vibrig::noise {

/// Noise that the data of a whole campaign show, where it is not the configured one.
struct Found {
    estimator::NoiseLevels levels;
    double dof = 0;  ///< 1/2 (N / u(N))^2 of the worst known of its gyros' N
    bool operator==(const Found&) const = default;
};

}  // namespace vibrig::noise
