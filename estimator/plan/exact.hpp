#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "estimator/plan/model.hpp"

namespace vibrig::estimator::plan {

using Counts = std::vector<std::size_t>;  ///< runs at each point

[[nodiscard]] Effort effort_of(const Counts& counts);

struct ExactSearch {
    std::size_t starts = 0;  ///< 0: as many as take some tenths of a second, 20 at least
    std::uint64_t seed = 1;
    Effort done;  ///< runs that are kept whatever is added; empty: none
};

/// The best plan of `runs` runs that Fedorov's exchange finds from random starts (Fedorov 1972, ch.
/// 3); where runs differ in cost, the one with most information per cost. Throws PlanError if there
/// are fewer runs than coefficients or the points do not determine them.
[[nodiscard]] Counts exact_design(const Problem& problem, std::size_t runs,
                                  const ExactSearch& search);

}  // namespace vibrig::estimator::plan
