#pragma once

#include <cmath>
#include <nlohmann/json.hpp>

#include "estimator/uncertainty/monte_carlo.hpp"

namespace vibrig::tool {

/// null for what is no number.
[[nodiscard]] inline nlohmann::ordered_json number_or_null(double value) {
    return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
}

/// What stands beside a coefficient's value: uncertainties and budget.
[[nodiscard]] nlohmann::ordered_json coefficient_json(
    const estimator::uncertainty::Coefficient& coefficient);
/// Verdict, fit, drift and all else that is not of one coefficient.
[[nodiscard]] nlohmann::ordered_json assessment_json(
    const estimator::uncertainty::Assessment& assessed);

[[nodiscard]] nlohmann::ordered_json monte_carlo_json(const estimator::uncertainty::MonteCarlo& of);

}  // namespace vibrig::tool
