#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "estimator/uncertainty/leverage.hpp"

namespace vibrig::tool {

/// The budget for people: of each coefficient value, u, U and its largest parts, or with `only` all
/// parts of that one; then what would shrink U most, and the verdict.
[[nodiscard]] std::string budget_table(const estimator::uncertainty::Assessment& assessed,
                                       std::optional<std::size_t> only = {});
/// What declared inputs allow, by kind of coefficient: medians of sigma, u and U, and the parts of
/// the budget that do most.
[[nodiscard]] std::string allowance_table(const estimator::uncertainty::Assessment& assessed);

}  // namespace vibrig::tool
