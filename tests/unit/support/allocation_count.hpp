#pragma once

#include <cstdint>

namespace vibrig::test {

/// Heap allocations of this thread so far, by operator new or by malloc (Eigen's way).
[[nodiscard]] std::uint64_t allocations() noexcept;

/// From now on this thread's allocations are also added to watched_allocations().
void watch_this_thread() noexcept;

/// Allocations of all watched threads so far; any thread may ask.
[[nodiscard]] std::uint64_t watched_allocations() noexcept;

}  // namespace vibrig::test
