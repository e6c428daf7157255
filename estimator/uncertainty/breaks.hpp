#pragma once

#include <cstddef>
#include <vector>

#include "estimator/filter/declared.hpp"
#include "estimator/uncertainty/signatures.hpp"

namespace vibrig::estimator::uncertainty {

/// Dwells, from 1, after which a power cut is likely: where one was seen, and at each end of a run
/// if the power goes with it. docs/theory/uncertainty.md, drift states.
[[nodiscard]] std::vector<std::size_t> breaks_of(const DwellTable& table, const Drift& drift);

}  // namespace vibrig::estimator::uncertainty
