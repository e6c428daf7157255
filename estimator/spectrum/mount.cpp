#include "estimator/spectrum/mount.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimator/filter/accelerometer_response.hpp"
#include "estimator/spectrum/profile.hpp"

namespace vibrig::estimator::spectrum {

std::optional<double> Mount::transmission(double hz) const {
    if (hard) return 1.0;
    if (measured.empty()) return std::sqrt(pads_power(hz, pads));
    const auto above = std::find_if(measured.begin(), measured.end(),
                                    [hz](const auto& point) { return point.first >= hz; });
    if (above == measured.end() || (above == measured.begin() && above->first > hz))
        return std::nullopt;
    if (above->first == hz) return above->second;
    return log_straight(*(above - 1), *above, hz);
}

double power_ratio(std::span<const std::pair<double, double>> ratios, std::span<const Band> bands) {
    if (ratios.empty() || bands.empty()) return 1;
    double sum = 0;
    for (const Band& band : bands) {
        const auto above =
            std::ranges::find_if(ratios, [&](const auto& point) { return point.first >= band.hz; });
        const double ratio = above == ratios.begin() ? above->second
                             : above == ratios.end() ? ratios.back().second
                                                     : log_straight(*(above - 1), *above, band.hz);
        sum += band.share * ratio * ratio;
    }
    return sum;
}

double Mount::lowest_hz() const noexcept {
    return hard || !measured.empty() ? 0 : std::numbers::sqrt2 * pads.hz;
}

double TableLimits::table_g(double hz) const noexcept {
    const double omega = 2 * std::numbers::pi * hz;
    return std::min({acceleration_g, velocity_mps * omega / gravity_mps2,
                     displacement_mm * 1e-3 * omega * omega / gravity_mps2});
}

}  // namespace vibrig::estimator::spectrum
