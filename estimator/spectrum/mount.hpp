#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "estimator/spectrum/elastic.hpp"

namespace vibrig::estimator::spectrum {

/// What stands between table and platform.
struct Mount {
    bool hard = false;  ///< bolted: the platform has the table's acceleration
    Resonance pads;     ///< else isolators with this natural frequency and damping,
    /// or, where it is not empty, what was measured: Hz and platform over table.
    std::vector<std::pair<double, double>> measured;

    /// Platform over table, straight on logarithmic scales between what was measured; none where
    /// that does not reach.
    [[nodiscard]] std::optional<double> transmission(double hz) const;
    /// Below it isolators amplify: there a rig does not shake. 0: anywhere.
    [[nodiscard]] double lowest_hz() const noexcept;
};

/// Peaks of a sine that the table can do.
struct TableLimits {
    double acceleration_g = 12, velocity_mps = 1.5, displacement_mm = 12;
    double gravity_mps2 = 9.80665;

    [[nodiscard]] double table_g(double hz) const noexcept;
};

}  // namespace vibrig::estimator::spectrum
