#include "drivers/sample/sync_clock.hpp"

#include <algorithm>
#include <cmath>
#include <span>

namespace vibrig::drivers {
namespace {

/// Scale of a normal distribution with the same median absolute deviation, times three.
constexpr double kThreeSigmaPerMad = 3 * 1.4826;
/// Deviations that are never called outliers, ns: a quarter of a CAN frame at 1 Mbit/s.
constexpr double kTolerance = 30'000;
constexpr double kSpacing = 20'000'000;  // ns

double median(std::span<double> values) noexcept {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>((values.size() - 1) / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;  // the lower of two: delays are never negative
}

/// Beyond it a residual is an outlier's. Whatever the median, none within the tolerance is one.
double limit_of(std::span<const double> residual, std::span<double> scratch) noexcept {
    if (std::ranges::max(residual) <= kTolerance) return kTolerance;
    std::ranges::copy(residual, scratch.begin());
    return kThreeSigmaPerMad * median(scratch) + kTolerance;
}

}  // namespace

SyncClock::SyncClock(Time nominal_period) noexcept
    : nominal_(static_cast<double>(nominal_period)),
      every_(std::max<std::int64_t>(1, std::llround(kSpacing / nominal_))) {}

void SyncClock::reset() noexcept {
    size_ = next_ = 0;
    offset_ = slope_ = 0;
    suspects_ = 0;
}

bool SyncClock::observe(std::int64_t count, Time stamp) noexcept {
    const Point point{count, stamp};
    const double spacing = nominal_ * static_cast<double>(every_);
    bool stepped = false;
    if (size_ > 0 && count < due_) return false;
    due_ = count + every_;
    if (size_ > 0) {
        const double off = static_cast<double>(stamp - time_of(count));
        if (std::abs(off) > kStepSpacings * spacing) {
            // Late stamps are an accident, and those of what catches up come closer together than
            // the device made them. Some at its own distance are the device's new time.
            const double apart = static_cast<double>(stamp - suspect_.stamp) -
                                 nominal_ * static_cast<double>(count - suspect_.count);
            if (suspects_ == 0 || std::abs(apart) > 0.5 * spacing) {
                suspect_ = point;
                suspects_ = 1;
                return false;
            }
            if (++suspects_ < kStepStamps) return false;
            const Point first = suspect_;
            reset();
            stepped = true;
            insert(first);
        }
        suspects_ = 0;
    }
    insert(point);
    fit();
    return stepped;
}

void SyncClock::insert(Point point) noexcept {
    points_[next_] = point;
    next_ = (next_ + 1) % kWindow;
    size_ = std::min(size_ + 1, kWindow);
    anchor_ = point;
}

void SyncClock::fit() noexcept {
    // x: counts after the anchor; y: ns after the nominal line through the anchor. Small numbers,
    // so doubles are exact.
    std::array<double, kWindow> x{};
    std::array<double, kWindow> y{};
    std::array<double, kWindow> residual{};
    std::array<double, kWindow> scratch{};
    for (std::size_t i = 0; i < size_; ++i) {
        x[i] = static_cast<double>(points_[i].count - anchor_.count);
        y[i] = static_cast<double>(points_[i].stamp - anchor_.stamp) - nominal_ * x[i];
    }
    const auto first = [this](auto& values) { return std::span(values).first(size_); };

    // Start from the nominal rate through the median, which up to half of the stamps being late
    // does not move. Through any of them, where all are within the tolerance of each other.
    const auto [least, most] = std::ranges::minmax(first(y));
    std::ranges::copy(first(y), scratch.begin());
    offset_ = most - least <= kTolerance ? y[0] : median(first(scratch));
    slope_ = 0;
    std::uint64_t used_before = 0;
    static_assert(kWindow <= 64, "a bit for each point");
    for (int pass = 0; pass < 3; ++pass) {
        for (std::size_t i = 0; i < size_; ++i) {
            residual[i] = std::abs(y[i] - offset_ - slope_ * x[i]);
        }
        const double limit = limit_of(first(residual), first(scratch));
        std::uint64_t used = 0;
        for (std::size_t i = 0; i < size_; ++i) {
            if (residual[i] <= limit) used |= std::uint64_t{1} << i;
        }
        if (used == used_before) return;  // the same points have the same line
        used_before = used;
        double n = 0, sx = 0, sy = 0;
        for (std::size_t i = 0; i < size_; ++i) {
            if (residual[i] > limit) continue;
            n += 1;
            sx += x[i];
            sy += y[i];
        }
        const double mx = sx / n;
        const double my = sy / n;
        double sxx = 0, sxy = 0;
        for (std::size_t i = 0; i < size_; ++i) {
            if (residual[i] > limit) continue;
            sxx += (x[i] - mx) * (x[i] - mx);
            sxy += (x[i] - mx) * (y[i] - my);
        }
        slope_ = sxx > 0 ? sxy / sxx : 0;
        offset_ = my - slope_ * mx;
    }
}

Time SyncClock::time_of(std::int64_t count) const noexcept {
    if (size_ == 0) return 0;
    const std::int64_t dx = count - anchor_.count;
    const double ns = offset_ + (nominal_ + slope_) * static_cast<double>(dx);
    // Rounded after the anchor is added, so that stamps off the microsecond grid come out on it.
    const Time exact = anchor_.stamp + static_cast<Time>(std::llround(ns));
    const Time half = kMicrosecond / 2;
    return (exact + (exact < 0 ? -half : half)) / kMicrosecond * kMicrosecond;
}

}  // namespace vibrig::drivers
