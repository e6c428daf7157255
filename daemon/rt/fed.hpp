#pragma once

#include <cstdint>

#include "estimator/filter/measurement.hpp"

namespace vibrig::rt {

/// One measurement as it went into the filter, on its way to the journal.
struct Fed {
    estimator::Measurement measurement;
    int run = 0, position = 0;
    bool first = false;  ///< begins its dwell
    std::uint32_t dropped_before = 0;
    std::uint64_t published_to = 0;  ///< the ring's own
};

}  // namespace vibrig::rt
