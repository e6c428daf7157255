#pragma once

#include <array>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "daemon/plot/chart.hpp"
#include "estimator/filter/angles.hpp"
#include "estimator/zeros/observability.hpp"
#include "estimator/zeros/simulation.hpp"
#include "estimator/zeros/together.hpp"

namespace vibrig::tool::zero_command {

namespace zeros = estimator::zeros;
using Json = nlohmann::ordered_json;

using estimator::kRadPerArcsec;
using estimator::kRadPerDeg;
inline constexpr std::array kAxisLetters{"x", "y", "z"};

[[nodiscard]] plot::Chart chart_of(const std::vector<zeros::CalibrationTrace>& trace);
[[nodiscard]] Json result_json(const zeros::CalibrationResult& r, const zeros::Observability& seen);
[[nodiscard]] std::string result_table(const zeros::CalibrationResult& r,
                                       const zeros::Observability& seen);
/// Zeros and misalignments separated by several calibrations together.
[[nodiscard]] Json apart_json(const zeros::ZerosApart& apart);
[[nodiscard]] std::string apart_table(const zeros::ZerosApart& apart);

}  // namespace vibrig::tool::zero_command
