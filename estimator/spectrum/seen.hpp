#pragma once

#include <span>

#include "estimator/filter/accelerometer_response.hpp"
#include "estimator/spectrum/elastic.hpp"

namespace vibrig::estimator::spectrum {

/// What the accelerometers see of a vibration with these shares of its mean square.
[[nodiscard]] inline Seen seen_of(const AccelerometerResponse& by,
                                  std::span<const Band> bands) noexcept {
    const bool all = by.flat() || bands.empty();
    Seen out{all ? 1.0 : 0.0, 0};
    for (const Band& band : bands) {
        if (!all) out.share += band.share * by.power(band.hz);
        out.error += band.share * by.skew_error(band.hz);
    }
    return out;
}

}  // namespace vibrig::estimator::spectrum
