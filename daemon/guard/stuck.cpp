#include "daemon/guard/stuck.hpp"

#include <algorithm>
#include <cmath>

#include "proto/safety.hpp"

namespace vibrig::guard {

namespace {

constexpr double kFlicker = 2;      // counts that one that is stuck may still change by
constexpr double kShouldMove = 20;  // counts of vibration that cannot be missed
constexpr double kLeastCount_g = 1e-6;
constexpr double kStuck_s = 1;
// Noise that is known to be there: up and down by so many counts in each of so many windows, so
// that by chance it is gone for a window once in hours, and that for a moment.
constexpr double kAlive = 10;
constexpr int kWindows = 10;
// A window at rest has less than this in it: the peaks of what is called rest, and noise.
constexpr double kAtRest_g = 2 * safety::kRest_g;
// A window of rest may be so much shorter than it is to be: in it all readings are old.
constexpr double kMostOfIt = 0.8;

}  // namespace

double seconds_between(const Moment& from, const Moment& to) noexcept {
    return drivers::to_seconds(std::min(to.wall - from.wall, to.rig - from.rig));
}

void Noise::add(drivers::Time rig, double raw_g, double count_g, double window_s) noexcept {
    const bool over = begun_ && rig >= *begun_ && drivers::to_seconds(rig - *begun_) >= window_s;
    if (over) {
        const double count = std::max(count_g, kLeastCount_g);
        const double most = std::max(rise_g_, fall_g_);
        // A slew turns gravity one way and is no noise; nor is what rings down, of which the last
        // windows are still.
        if (most <= kFlicker * count)
            windows_ = 0;
        else if (std::min(rise_g_, fall_g_) > kAlive * count && most < kAtRest_g)
            ++windows_;
        known_ = known_ || windows_ >= kWindows;
    }
    if (over || !begun_ || rig < *begun_) {
        begun_ = rig;
        lowest_g_ = highest_g_ = raw_g;
        rise_g_ = fall_g_ = 0;
        return;
    }
    lowest_g_ = std::min(lowest_g_, raw_g);
    highest_g_ = std::max(highest_g_, raw_g);
    rise_g_ = std::max(rise_g_, raw_g - lowest_g_);
    fall_g_ = std::max(fall_g_, highest_g_ - raw_g);
}

void StuckWatch::add(drivers::Time rig, const std::array<double, 3>& raw_g) noexcept {
    newest_ = rig;
    for (std::size_t i = 0; i < axes_; ++i) {
        noise_[i].add(rig, raw_g[i], counts_g_[i], window_s_);
        const bool first = !since_[i] || *since_[i] > rig;
        const bool moved = std::abs(raw_g[i] - shown_g_[i]) > kFlicker * counts_g_[i];
        if (!first && !moved) continue;
        if (!first) doubted_[i] = false;
        shown_g_[i] = raw_g[i];
        since_[i] = rig;
    }
}

bool StuckWatch::frozen() const noexcept {
    for (std::size_t i = 0; i < axes_; ++i)
        if (noise_[i].known() && since_[i] &&
            drivers::to_seconds(newest_ - *since_[i]) >= kMostOfIt * window_s_)
            return true;
    return false;
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
