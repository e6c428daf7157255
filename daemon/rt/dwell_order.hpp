#pragma once

#include <array>
#include <cstdint>

#include "drivers/base/clock.hpp"
#include "drivers/sample/sample.hpp"
#include "estimator/identification/identification.hpp"

namespace vibrig::rt {

/// Control to estimator: the dwell that samples with from <= time < to belong to. Announced ahead
/// of `from`, so that it does not matter which thread is faster.
struct DwellOrder {
    drivers::Time from = 0;
    drivers::Time to = 0;
    estimator::DwellInfo dwell;
    /// Taken off the raw specific force, on top of the configuration's zeros; g.
    std::array<double, 3> zero_g{};
    /// What those zeros leave uncertain of the vertical there, g, 1 sigma; 0: they were not taken.
    double level_sigma_g = 0;
    bool cancel = false;  ///< end the dwell in progress with what it has
    std::uint32_t dropped_before = 0;
    std::uint64_t published_to = 0;  ///< the ring's own
};

/// A sample of a dwell as the filter takes it.
[[nodiscard]] inline estimator::Measurement measurement_of(
    const drivers::Sample& sample, drivers::Time from,
    const std::array<double, 3>& zero_g) noexcept {
    return {.time_s = drivers::to_seconds(sample.time - from),
            .angle_rad = sample.angle,
            .force_g = {sample.force[0] - zero_g[0], sample.force[1] - zero_g[1],
                        sample.force[2] - zero_g[2]},
            .angles_good = sample.angles_good(),
            .force_good = sample.force_good()};
}

/// Estimator to control: the dwell is over.
struct DwellDone {
    estimator::DwellSummary summary;
    std::uint32_t dropped_before = 0;
    std::uint64_t published_to = 0;  ///< the ring's own
};

}  // namespace vibrig::rt
