#pragma once

#include "daemon/configuration/configuration.hpp"

namespace vibrig {

/// The configuration with the order of its campaign's dwells worked out: with the 14 positions of
/// Table 1 at two levels a known one, else some tenths of a second.
[[nodiscard]] configuration::Loaded put_in_order(configuration::Loaded loaded);

/// Places in the list of levels, each with all positions.
[[nodiscard]] std::vector<std::size_t> visit_sequence(
    const configuration::Configuration& configuration);

}  // namespace vibrig
