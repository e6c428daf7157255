#pragma once

#include <chrono>
#include <cstdint>

namespace vibrig::record {

/// A disk that refused is tried again after so long.
inline constexpr std::int64_t kRetryNs = 1'000'000'000;

/// Disks live in wall time, whatever clock the daemon has.
inline std::int64_t wall_ns() {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(
               std::chrono::steady_clock::now().time_since_epoch())
        .count();
}

}  // namespace vibrig::record
