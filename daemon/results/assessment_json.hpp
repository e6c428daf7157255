#pragma once

#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <string>

#include "estimator/uncertainty/monte_carlo.hpp"
#include "proto/json_number.hpp"

namespace vibrig::tool {

using proto::number_or_null;

/// null for an empty text.
[[nodiscard]] inline nlohmann::ordered_json text_or_null(const std::string& text) {
    return text.empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(text);
}
[[nodiscard]] nlohmann::ordered_json numbers_or_null(const auto& values) {
    auto list = nlohmann::ordered_json::array();
    for (const double value : values) list.push_back(number_or_null(value));
    return list;
}
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
