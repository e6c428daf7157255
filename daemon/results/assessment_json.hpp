#pragma once

#include <nlohmann/json.hpp>

#include "estimator/uncertainty/monte_carlo.hpp"
#include "proto/json_number.hpp"

namespace vibrig::tool {

using proto::number_or_null;

/// What stands beside a coefficient's value: uncertainties and budget.
[[nodiscard]] nlohmann::ordered_json coefficient_json(
    const estimator::uncertainty::Coefficient& coefficient);
/// Verdict, fit, drift and all else that is not of one coefficient.
[[nodiscard]] nlohmann::ordered_json assessment_json(
    const estimator::uncertainty::Assessment& assessed);

[[nodiscard]] nlohmann::ordered_json monte_carlo_json(const estimator::uncertainty::MonteCarlo& of);

}  // namespace vibrig::tool
