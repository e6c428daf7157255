#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "drivers/base/clock.hpp"

namespace vibrig::rt {

/// How long frames waited: from the kernel's stamp on the oldest one of a batch until the interlock
/// has judged it and its samples are in the rings. One thread.
struct FrameLatency {
    /// Upper bounds, ms; one more class is open.
    static constexpr std::array<double, 10> kBounds_ms{0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50};
    std::array<std::uint64_t, kBounds_ms.size() + 1> count{};
    double largest_ms = 0, sum_ms = 0;

    void add(drivers::Time taken) noexcept {
        const double ms = drivers::to_seconds(taken) * 1e3;
        const auto* const at = std::lower_bound(kBounds_ms.begin(), kBounds_ms.end(), ms);
        ++count[static_cast<std::size_t>(at - kBounds_ms.begin())];
        largest_ms = std::max(largest_ms, ms);
        sum_ms += ms;
    }
};

}  // namespace vibrig::rt
