#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

namespace vibrig::estimator {

/// At `hz` between two points, straight on logarithmic scales.
[[nodiscard]] inline double log_straight(const std::pair<double, double>& below,
                                         const std::pair<double, double>& above,
                                         double hz) noexcept {
    const double part = std::log(hz / below.first) / std::log(above.first / below.first);
    return below.second * std::pow(above.second / below.second, part);
}

/// How accelerometers see what vibrates, over frequency (docs/theory/spectrum.md).
struct AccelerometerResponse {
    double bandwidth_hz = 0;  ///< where they see half of the power; 0: no limit
    int order = 1;            ///< of the Butterworth low-pass that they are then
    /// In its place: Hz and what is shown over what is, straight on logarithmic scales between the
    /// points. Below the first as at it, above the last nothing is known.
    std::vector<std::pair<double, double>> table{};
    double skew_ms = 0;  ///< between the samples of two accelerometers, at most

    [[nodiscard]] bool flat() const noexcept { return !(bandwidth_hz > 0) && table.empty(); }
    /// What they show of a sine's mean square, |A(hz)|^2; 0 where it is not known.
    [[nodiscard]] double power(double hz) const noexcept {
        if (!table.empty()) {
            const double ratio = in_table(hz);
            return ratio * ratio;
        }
        return bandwidth_hz > 0 ? 1 / (1 + std::pow(hz / bandwidth_hz, 2 * order)) : 1;
    }
    /// Relative uncertainty of the second moment that comes of it: the readings of two axes that
    /// share a motion do not add up.
    [[nodiscard]] double skew_error(double hz) const noexcept {
        const double part = std::numbers::pi * hz * 1e-3 * skew_ms;
        return part * part;
    }

  private:
    [[nodiscard]] double in_table(double hz) const noexcept {
        const auto above = std::find_if(table.begin(), table.end(),
                                        [hz](const auto& point) { return point.first >= hz; });
        if (above == table.end()) return 0;
        if (above == table.begin() || above->first == hz) return above->second;
        return log_straight(*(above - 1), *above, hz);
    }
};

/// What accelerometers see of one vibration.
struct Seen {
    double share = 1;  ///< of its mean square
    double error = 0;  ///< relative, of the second moment after that: 1 sigma
};

/// Below it a line is refused: what is left would be divided by too small a number.
inline constexpr double kLeastSeen = 0.5;

}  // namespace vibrig::estimator
