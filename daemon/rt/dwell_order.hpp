#pragma once

#include <array>
#include <cstdint>

#include "drivers/clock.hpp"
#include "estimator/identification.hpp"

namespace vibrig::rt {

/// Control to estimator: the dwell that samples with from <= time < to belong to. Announced ahead
/// of `from`, so that it does not matter which thread is faster.
struct DwellOrder {
    drivers::Time from = 0;
    drivers::Time to = 0;
    estimator::DwellInfo dwell;
    /// Taken off the raw specific force, on top of the configuration's zeros; g.
    std::array<double, 3> zero_g{};
    bool cancel = false;  ///< end the dwell in progress with what it has
    std::uint32_t dropped_before = 0;
};

/// Estimator to control: the dwell is over.
struct DwellDone {
    estimator::DwellSummary summary;
    std::uint32_t dropped_before = 0;
};

}  // namespace vibrig::rt
