#include "estimator/saturation_detector.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vibrig::estimator {
namespace {

// Six sigma: the crests of an unhurt sine are within. A converter with steps above the noise puts
// them on one value, too, so that nothing is told of it.
constexpr double kSpread = 6;
constexpr double kCoarsest = 1;
// Fewer readings at the end of the range hardly change the level: a sine whose crests are cut for
// 2 % of the time loses 0.01 % of its mean square.
constexpr double kFewestAtEnd = 20;
constexpr double kLeastShareAtEnd = 0.02;
// A source without noise shows every phase of a vibration again and again, not only its crests: of
// 50 readings one is the same but for rounding. With noise it is off by some tenths of that.
constexpr double kNoiseless = 1e-3;
constexpr double kLeastMoved = 0.05;  ///< of all readings

}  // namespace

void SaturationDetector::End::add(double reading, double spread) noexcept {
    // Readings count upwards here; what has been left behind by more than the spread is no crest.
    if (at == 0 || reading > extreme) {
        next_to = at > 0 && reading - extreme < spread ? next_to + at : 0;
        extreme = reading;
        at = 1;
    } else if (reading == extreme) {
        ++at;
    } else if (extreme - reading < spread) {
        ++next_to;
    }
}

void SaturationDetector::add(const std::array<double, 3>& force_g) noexcept {
    for (std::size_t k = 0; k < 3; ++k) {
        Axis& a = axes_[k];
        const double reading = force_g[k];
        double nearest = std::numeric_limits<double>::infinity();
        for (std::size_t i = 0; i < std::min<std::size_t>(a.count, kKept); ++i) {
            const double difference = std::abs(reading - a.kept[i]);
            nearest = std::min(nearest, difference);
            if (difference > 0 && (a.step == 0 || difference < a.step)) a.step = difference;
        }
        if (nearest > kNoiseless * noise_g_) ++a.moved;
        a.kept[a.count % kKept] = reading;
        ++a.count;
        a.highest.add(reading, kSpread * noise_g_);
        a.lowest.add(-reading, kSpread * noise_g_);
    }
}

bool SaturationDetector::Axis::saturated(const End& end) const noexcept {
    return end.at >= kFewestAtEnd && end.at >= kLeastShareAtEnd * count && end.at > end.next_to;
}

bool SaturationDetector::Axis::saturated(double noise_g) const noexcept {
    if (step == 0 || step > kCoarsest * noise_g || moved < kLeastMoved * count) return false;
    return saturated(highest) || saturated(lowest);
}

int SaturationDetector::axis() const noexcept {
    for (std::size_t k = 0; k < 3; ++k) {
        if (axes_[k].saturated(noise_g_)) return static_cast<int>(k);
    }
    return -1;
}

}  // namespace vibrig::estimator
