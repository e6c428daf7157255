#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

namespace vibrig::estimator {

/// The upper of two in the middle. Of one value at least; they are left in another order.
[[nodiscard]] inline double median(std::span<double> values) noexcept {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

}  // namespace vibrig::estimator
