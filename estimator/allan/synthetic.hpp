#pragma once

#include <cstdint>
#include <vector>

#include "estimator/allan/fit.hpp"

namespace vibrig::estimator::allan {

/// n rates (deg/h) with the noise of `terms`; the same seed gives the same numbers. Flicker is a
/// sum of Gauss-Markov processes whose times double from tau0/64 to sixteen records.
[[nodiscard]] std::vector<double> synthetic_rate(const Terms& terms, std::size_t n, double tau0,
                                                 std::uint64_t seed);

/// Adds a Gauss-Markov process of standard deviation s (deg/h) and correlation time tm (s),
/// averaged over each step.
void add_gauss_markov(std::vector<double>& rate, double tau0, double s, double tm,
                      std::uint64_t seed);

}  // namespace vibrig::estimator::allan
