#pragma once

#include <cstddef>

namespace vibrig::estimator::testing {

/// Heap allocations of this thread so far, by new or by malloc (Eigen's way). Under a sanitizer
/// only new is counted.
[[nodiscard]] std::size_t allocations() noexcept;

}  // namespace vibrig::estimator::testing
