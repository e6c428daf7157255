#include "estimator/level/stuck_detector.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace vibrig::estimator {
namespace {

constexpr double kChance = 1e-15;  ///< of a working resolver being taken for a stuck one
constexpr double kFewest = 20;
constexpr double kHighestChance = 0.5;  ///< of two equal readings; above it nothing is reported

}  // namespace

StuckDetector::StuckDetector(const Settings& settings) noexcept {
    // Two readings with noise sigma fall on the same step of the converter with about this chance.
    const double lsb = 1296000.0 / std::exp2(settings.resolver_bits);  // arcsec
    const double equal = lsb / (2.0 * std::sqrt(std::numbers::pi) * settings.resolver_arcsec);
    if (!(equal < kHighestChance)) return;
    limit_ =
        static_cast<std::size_t>(std::max(kFewest, std::ceil(std::log(kChance) / std::log(equal))));
}

bool StuckDetector::stuck(const std::array<double, 3>& angle_rad) noexcept {
    if (limit_ == 0) return false;
    bool still = false, moving = false;
    for (std::size_t k = 0; k < 3; ++k) {
        if (angle_rad[k] == last_[k]) {
            ++repeats_[k];
            if (moves_[k] > 0) --moves_[k];
        } else {
            repeats_[k] = 0;
            moves_[k] = std::min(moves_[k] + 1, limit_);
        }
        last_[k] = angle_rad[k];
        still = still || repeats_[k] >= limit_;
        moving = moving || 2 * moves_[k] > limit_;
    }
    return still && moving;
}

}  // namespace vibrig::estimator
