#pragma once

#include <chrono>
#include <cstdint>
#include <string>

namespace vibrig::record {

/// A disk that refused is tried again after so long.
inline constexpr std::int64_t kRetryNs = 1'000'000'000;

/// Disks live in wall time, whatever clock the daemon has.
inline std::int64_t wall_ns() {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(
               std::chrono::steady_clock::now().time_since_epoch())
        .count();
}

/// Empty if `folder` has `keep_free_mb` left, or if nobody knows; else what was found and expected.
[[nodiscard]] std::string lack_of_room(const std::string& folder, double keep_free_mb);

}  // namespace vibrig::record
