#pragma once

#include <optional>
#include <span>
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

/// What the mean square of a vibration with these shares at the platform becomes where the
/// transmission is, at frequencies that rise, so many times what it was taken for: in between
/// straight on logarithmic scales, beyond them as at the nearest. 1 where nothing is known.
[[nodiscard]] double power_ratio(std::span<const std::pair<double, double>> ratios,
                                 std::span<const Band> bands);

/// Peaks of a sine that the table can do.
struct TableLimits {
    double acceleration_g = 12, velocity_mps = 1.5, displacement_mm = 12;
    double gravity_mps2 = 9.80665;

    [[nodiscard]] double table_g(double hz) const noexcept;
};

}  // namespace vibrig::estimator::spectrum
