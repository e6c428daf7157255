// What `vibrig zero` reads, and what it says.
#pragma once

#include <array>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "daemon/allan/column_file.hpp"
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

/// Six columns of increments, each with its times, and the azimuth, which may be empty. Throws
/// std::runtime_error with file, line, column and value for a time that is missing or does not
/// grow, and for numbers that no unit has; a missing increment or azimuth is a gap.
void check_increments(const std::string& file, const std::array<ColumnFile, 6>& columns,
                      const ColumnFile& azimuth);

[[nodiscard]] plot::Chart chart_of(const std::vector<zeros::CalibrationTrace>& trace);
[[nodiscard]] Json result_json(const zeros::CalibrationResult& r, const zeros::Observability& seen);
[[nodiscard]] std::string result_table(const zeros::CalibrationResult& r,
                                       const zeros::Observability& seen);
/// Zeros and misalignments separated by several calibrations together; where one of them is not
/// valid there are none, null in JSON.
[[nodiscard]] Json apart_json(const zeros::ZerosApart& apart, bool valid);
[[nodiscard]] std::string apart_table(const zeros::ZerosApart& apart, bool valid);

}  // namespace vibrig::tool::zero_command
