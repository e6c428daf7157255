#pragma once

#include <string>
#include <vector>

#include "estimator/filter/accelerometer_response.hpp"
#include "estimator/spectrum/elastic.hpp"
#include "proto/recording_csv.hpp"

namespace vibrig::tool {

/// What the samples of a dwell say against the lines with which it is said to have shaken: the one
/// that is furthest from its share, as "found .., expected .."; empty: nothing, or nobody could
/// tell, since lines or their aliases are too near to one another, to zero or to half the rate.
/// A line's power is what a sine within 0.2 % of its frequency explains at most; half and twice of
/// what is stated, and a fiftieth of all that shakes, are no contradiction.
[[nodiscard]] std::string against_lines(const std::vector<const proto::RecordingRow*>& rows,
                                        const std::vector<estimator::spectrum::Band>& lines,
                                        const estimator::AccelerometerResponse& seen_by);

}  // namespace vibrig::tool
