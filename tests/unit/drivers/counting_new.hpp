#pragma once

#include <cstdint>

namespace vibrig::test {

/// Calls of operator new in this thread since it started.
[[nodiscard]] std::uint64_t allocations() noexcept;

}  // namespace vibrig::test
