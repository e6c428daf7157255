#pragma once

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "daemon/results/json_values.hpp"
#include "estimator/uncertainty/monte_carlo.hpp"

namespace vibrig::tool {

/// Row by row.
[[nodiscard]] inline nlohmann::ordered_json matrix_or_null(const Eigen::MatrixXd& of) {
    auto rows = nlohmann::ordered_json::array();
    for (const auto& row : of.rowwise()) rows.push_back(numbers_or_null(row));
    return rows;
}

/// What stands beside a coefficient's value: uncertainties and budget.
[[nodiscard]] nlohmann::ordered_json coefficient_json(
    const estimator::uncertainty::Coefficient& coefficient);
/// Verdict, fit, drift and all else that is not of one coefficient.
[[nodiscard]] nlohmann::ordered_json assessment_json(
    const estimator::uncertainty::Assessment& assessed);

[[nodiscard]] nlohmann::ordered_json monte_carlo_json(const estimator::uncertainty::MonteCarlo& of);

}  // namespace vibrig::tool
