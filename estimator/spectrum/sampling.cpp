#include "estimator/spectrum/sampling.hpp"

#include <cmath>

namespace vibrig::estimator::spectrum {

bool forbidden(double hz, double sample_hz, double window_s, int harmonics) noexcept {
    for (int n = 1; n <= harmonics; ++n) {
        // A hair wider than the rule, so that the rounding of n f does not open it.
        if (std::abs(std::remainder(n * hz, sample_hz)) < 4 / window_s - 1e-9) return true;
    }
    return false;
}

double nearest_free(double hz, double sample_hz, double window_s, int harmonics,
                    double step_hz) noexcept {
    if (!forbidden(hz, sample_hz, window_s, harmonics)) return hz;
    for (int k = 1; k < 100000; ++k) {
        // Counted from whole steps, so that 60 becomes 60.2 and not 60.1999.
        const double up = std::round((hz + k * step_hz) / step_hz) * step_hz;
        const double down = std::round((hz - k * step_hz) / step_hz) * step_hz;
        if (!forbidden(up, sample_hz, window_s, harmonics)) return up;
        if (down > 0 && !forbidden(down, sample_hz, window_s, harmonics)) return down;
    }
    return hz;
}

}  // namespace vibrig::estimator::spectrum
