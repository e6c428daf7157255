#include "estimator/level/saturation_detector.hpp"

#include <Eigen/Core>
#include <cmath>

namespace vibrig::estimator {
namespace {

constexpr double kSpread = 6;  ///< of the noise: crests of an unhurt sine are within
// Fewer readings at the end of the range hardly change the level: a sine whose crests are cut for
// 3 % of the time loses 0.04 % of its mean square.
constexpr double kFewestAtEnd = 20;
constexpr double kLeastShareAtEnd = 0.03;
// A source without noise shows every phase of a vibration again and again but for rounding, a
// coarse converter nearly so. Of 12 readings of a phase none is the same for half of all only if
// the steps are below a fifth of the noise, and then crests are spread over many of them.
constexpr double kSame = 1e-3;  ///< of the noise
constexpr double kLeastMoved = 0.5;
constexpr double kRounding = 1e-5;  ///< of the range: a converter's last step and decimals

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
        if (a.count > 0 && a.nearest(reading) > kSame * noise_g_) ++a.moved;
        if (range_g_ > 0 && std::abs(reading) >= range_g_ * (1 - kRounding)) ++a.beyond;
        a.kept[a.count % kKept] = reading;
        ++a.count;
        a.highest.add(reading, kSpread * noise_g_);
        a.lowest.add(-reading, kSpread * noise_g_);
    }
}

double SaturationDetector::Axis::nearest(double reading) const noexcept {
    // Twenty side by side: one after the other, each would wait for the one before.
    constexpr std::size_t kSide = 20;
    static_assert(kKept % kSide == 0);
    if (count < kKept) {
        const Eigen::Map<const Eigen::ArrayXd> first(kept.data(), count);
        return (reading - first).abs().minCoeff();
    }
    using Side = Eigen::Array<double, kSide, 1>;
    Side least = (reading - Side::Map(kept.data())).abs();
    for (std::size_t at = kSide; at < kKept; at += kSide)
        least = least.min((reading - Side::Map(&kept[at])).abs());
    return least.minCoeff();
}

bool SaturationDetector::Axis::enough(std::uint32_t readings) const noexcept {
    return readings >= kFewestAtEnd && readings >= kLeastShareAtEnd * count;
}

bool SaturationDetector::Axis::saturated(const End& end) const noexcept {
    // An axis across the vibration may show hardly anything but one value.
    return enough(end.at) && 2 * end.at <= count && end.at > end.next_to &&
           moved > kLeastMoved * (count - end.at);
}

int SaturationDetector::axis() const noexcept {
    for (std::size_t k = 0; k < 3; ++k) {
        const Axis& a = axes_[k];
        if (a.enough(a.beyond) || a.saturated(a.highest) || a.saturated(a.lowest))
            return static_cast<int>(k);
    }
    return -1;
}

}  // namespace vibrig::estimator
