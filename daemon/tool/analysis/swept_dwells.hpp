#pragma once

#include <string>
#include <vector>

#include "estimator/filter/measurement.hpp"
#include "estimator/spectrum/sweep.hpp"
#include "proto/recording_csv.hpp"

namespace vibrig::tool {

/// Whether the frequency of a dwell goes through a range; a dwell is not empty.
[[nodiscard]] bool is_sweep(const std::vector<const proto::RecordingRow*>& dwell) noexcept;

/// The sweep of a dwell that is one. Throws, naming file and line, where the frequency turns round,
/// where the accelerometers do not show it, and where no block of it can be used.
[[nodiscard]] estimator::spectrum::Sweep sweep_of(
    const estimator::Settings& settings, const std::vector<const proto::RecordingRow*>& dwell,
    const std::string& file);

/// As a filter takes it.
[[nodiscard]] estimator::Measurement measurement_of(const proto::RecordingRow& row) noexcept;

}  // namespace vibrig::tool
