#include "daemon/guard/stuck.hpp"

#include <algorithm>
#include <cmath>

namespace vibrig::guard {

namespace {

constexpr double kFlicker = 2;      // counts that one that is stuck may still change by
constexpr double kShouldMove = 20;  // counts of vibration that cannot be missed
constexpr double kLeastCount_g = 1e-6;
constexpr double kStuck_s = 1;

}  // namespace

double seconds_between(const Moment& from, const Moment& to) noexcept {
    return drivers::to_seconds(std::min(to.wall - from.wall, to.rig - from.rig));
}

void StuckWatch::add(drivers::Time rig, const std::array<double, 3>& raw_g) noexcept {
    newest_ = rig;
    for (std::size_t i = 0; i < axes_; ++i) {
        const bool first = !since_[i] || *since_[i] > rig;
        const bool moved = std::abs(raw_g[i] - shown_g_[i]) > kFlicker * counts_g_[i];
        if (!first && !moved) continue;
        if (!first) doubted_[i] = false;
        shown_g_[i] = raw_g[i];
        since_[i] = rig;
    }
}

void StuckWatch::expect(const Moment& now, double peak_g) noexcept {
    const double norm = std::hypot(shown_g_[0], shown_g_[1], shown_g_[2]);
    for (std::size_t i = 0; i < axes_; ++i) {
        // One axis alone is along the vibration.
        const double share = axes_ == 1 ? 1 : norm > 0 ? std::abs(shown_g_[i]) / norm : 0;
        const double count = std::max(counts_g_[i], kLeastCount_g);
        if (!(peak_g * share > kShouldMove * count)) {
            expected_since_[i].reset();
            continue;
        }
        if (!expected_since_[i]) expected_since_[i] = now;
        // By readings that came: a silent one is not known, which is more.
        if (since_[i] && drivers::to_seconds(newest_ - *since_[i]) >= kStuck_s &&
            seconds_between(*expected_since_[i], now) >= kStuck_s)
            doubted_[i] = true;
    }
}

}  // namespace vibrig::guard
