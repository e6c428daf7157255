#include "estimator/spectrum/mount.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

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
    const auto& below = *(above - 1);
    const double part = std::log(hz / below.first) / std::log(above->first / below.first);
    return below.second * std::pow(above->second / below.second, part);
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
