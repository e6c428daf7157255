#pragma once

#include <cstddef>

namespace vibrig::estimator::allan {

/// sum[k] += sum over i of (x[i + 2m] - 2 x[i + m] + x[i])^2 for each m = factors[k], all factors
/// in one pass over x in blocks that stay in the first cache. Picks the instruction set at run
/// time.
void add_overlapping_squares(const double* x, std::size_t points, const std::size_t* factors,
                             std::size_t count, double* sum) noexcept;

}  // namespace vibrig::estimator::allan
