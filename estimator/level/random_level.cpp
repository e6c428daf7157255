#include "estimator/level/random_level.hpp"

#include <algorithm>
#include <cmath>

namespace vibrig::estimator {

double realised_error(double n, double sample_hz, double highest_hz) noexcept {
    return sample_hz >= 2 * highest_hz ? 0 : std::sqrt(2 / n);
}

void RandomLevel::add(double vertical_force_g) noexcept {
    const double off = vertical_force_g - 1;
    ++count_;
    sum_ += off;
    square_ += off * off;
}

RandomLevel::Level RandomLevel::level(const RandomVibration& profile, double noise_g,
                                      double period_s, double span_s) const noexcept {
    Level out;
    if (!(count_ > 1 && period_s > 0 && span_s > 0)) return out;
    const double mean = sum_ / count_;
    const double variance = std::max(0.0, square_ / count_ - mean * mean) * count_ / (count_ - 1);
    const double seen = std::max(0.0, variance - noise_g * noise_g);
    out.mean_force_g = 1 + mean;
    out.mean_force_sigma_g = std::sqrt(variance / count_);
    const double stated = profile.mean_square_g2;
    const double by_samples = realised_error(count_, 1 / period_s, profile.highest_hz);
    const double by_profile =
        std::hypot(profile.gain_error,
                   profile.bandwidth_hz > 0 ? 1 / std::sqrt(profile.bandwidth_hz * span_s) : 0);
    out.sigmas_apart = std::abs(seen / stated - 1) / std::hypot(by_samples, by_profile);
    if (by_samples == 0) {
        out.mean_square_g2 = seen;
        return out;
    }
    const double a = 1 / (by_samples * by_samples), b = 1 / (by_profile * by_profile);
    out.mean_square_g2 = (a * seen + b * stated) / (a + b);
    out.relative_error = 1 / std::sqrt(a + b);
    return out;
}

}  // namespace vibrig::estimator
