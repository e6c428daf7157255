#pragma once

#include <optional>
#include <span>

#include "estimator/uncertainty/assessment.hpp"

namespace vibrig::estimator::uncertainty {

/// An accelerometer that is read at another time than another one, more so than declared: it makes
/// motion a quarter period apart wherever the two share the vibration, and nowhere else
/// (docs/theory/uncertainty.md).
[[nodiscard]] std::optional<Reason> accelerometers_apart(const Settings& settings,
                                                         std::span<const DwellRow> rows,
                                                         const Assessment& assessed);

}  // namespace vibrig::estimator::uncertainty
