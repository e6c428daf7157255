#pragma once

#include <string_view>
#include <vector>

#include "estimator/filter/ud_kernel.hpp"

namespace vibrig::estimator {

/// The instruction set in use: what this processor has at best, unless another one was forced.
[[nodiscard]] std::string_view instruction_set() noexcept;
/// What the estimator was compiled with, "g++ 12.2.0": the last bits depend on it.
[[nodiscard]] std::string_view compiler() noexcept;
/// Those that this build holds and this processor runs, slowest first ("sse2", "avx2", "avx512").
[[nodiscard]] std::vector<std::string_view> instruction_sets();
/// Filters built from now on use this one; "auto": the best. False, and nothing changes, if this
/// build or this processor does not have it. Not to be called while other threads build filters.
[[nodiscard]] bool force_instruction_set(std::string_view name) noexcept;

/// The same for a name that a person typed; throws SettingsError naming it and those there are.
void use_instruction_set(std::string_view name);

[[nodiscard]] const UdKernel& ud_kernel() noexcept;

}  // namespace vibrig::estimator
