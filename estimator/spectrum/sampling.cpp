#include "estimator/spectrum/sampling.hpp"

#include <cmath>

#include "estimator/filter/text.hpp"

namespace vibrig::estimator::spectrum {

bool forbidden(double hz, double sample_hz, double window_s, int harmonics) noexcept {
    for (int n = 1; n <= harmonics; ++n) {
        // A hair wider than the rule, so that the rounding of n f does not open it.
        if (std::abs(std::remainder(n * hz, sample_hz)) < 4 / window_s - 1e-9) return true;
    }
    return false;
}

std::optional<double> nearest_free(double hz, double sample_hz, double window_s) noexcept {
    constexpr double kStep_hz = 0.1;
    for (const int harmonics : {kHarmonicsPlanned, kHarmonics}) {
        const auto free = [&](double other) {
            return other > 0 && !forbidden(other, sample_hz, window_s, harmonics);
        };
        if (free(hz)) return hz;
        // What is forbidden repeats itself from one multiple of the rate to the next.
        for (int k = 1; k * kStep_hz <= sample_hz + kStep_hz; ++k) {
            // Counted from whole steps, so that 60 becomes 60.2 and not 60.1999.
            const double up = std::round((hz + k * kStep_hz) / kStep_hz) * kStep_hz;
            const double down = std::round((hz - k * kStep_hz) / kStep_hz) * kStep_hz;
            if (free(up)) return up;
            if (free(down)) return down;
        }
    }
    return {};
}

std::string nearest_free_words(double hz, double sample_hz, double window_s) {
    const auto free = nearest_free(hz, sample_hz, window_s);
    return free ? text("the nearest free one is %.6g Hz", *free)
                : text(
                      "none is free with a vibration.level_window_s of %g: a longer one, or "
                      "faster samples",
                      window_s);
}

}  // namespace vibrig::estimator::spectrum
