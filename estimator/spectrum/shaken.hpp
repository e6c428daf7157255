#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "estimator/spectrum/kind.hpp"
#include "estimator/spectrum/sweep.hpp"

namespace vibrig::estimator::spectrum {

/// What a campaign's dwells shook with, beside their rows.
struct Shaken {
    /// Kinds of random vibration by their numbers in the controller, DwellRow::profile.
    std::vector<std::pair<std::uint16_t, Kind>> profiles;
    std::vector<Sweep> sweeps;
    /// Bands at the platform of the random dwells whose PSD a controller reported, by
    /// DwellRow::psd, from 1.
    std::vector<std::vector<Band>> psds;
};

}  // namespace vibrig::estimator::spectrum
