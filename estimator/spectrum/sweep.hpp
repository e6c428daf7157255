#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <vector>

namespace vibrig::estimator::spectrum {

/// A second, or so, of a dwell whose frequency goes through a range.
struct SweepBlock {
    double time_s = 0;                  ///< its middle
    std::array<double, 3> angle_rad{};  ///< mean of the raw encoder angles, without wraps
    std::size_t samples = 0;            ///< of that mean
    double from_hz = 0, to_hz = 0;      ///< at its ends
    /// Second moment of the vibration's specific force, level frame, g^2; none: not known, as where
    /// a harmonic falls on a multiple of the sampling rate.
    std::optional<std::array<std::array<double, 3>, 3>> moment = {};
};

/// A dwell under one sweep, block after block, none left out.
struct Sweep {
    int run = 0, position = 0;
    std::vector<SweepBlock> blocks;

    [[nodiscard]] std::size_t known() const noexcept {
        return static_cast<std::size_t>(std::ranges::count_if(
            blocks, [](const SweepBlock& block) { return block.moment.has_value(); }));
    }
};

}  // namespace vibrig::estimator::spectrum
