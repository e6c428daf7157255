#include "estimator/allan/sliding_variance.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "estimator/allan/edf.hpp"
#include "estimator/allan/series.hpp"

namespace vibrig::estimator::allan {

namespace {

constexpr double kLargestRelativeError = 1e-9;
constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();

constexpr double kFalls = 3;  // e-folds of the exponential window

/// `at`: 0 oldest, 1 newest.
double weight_of(WindowShape shape, double at) noexcept {
    return shape == WindowShape::hann ? std::pow(std::sin(std::numbers::pi * at), 2)
                                      : std::exp(kFalls * (at - 1));
}

}  // namespace

double share_of(WindowShape shape) noexcept {
    switch (shape) {
        case WindowShape::hann:
            return 2.0 / 3;  // (1/2)^2 / (3/8)
        case WindowShape::exponential:
            return 2 / kFalls * std::tanh(kFalls / 2);
        default:
            return 1;
    }
}

SlidingVariance::SlidingVariance(double tau0, std::size_t window, std::vector<std::size_t> factors)
    : tau0_(tau0),
      window_(window),
      factors_(std::move(factors)),
      // One angle more than the window's, for the one that is leaving.
      mask_(std::bit_ceil(window + 2) - 1),
      angle_(mask_ + 1, 0.0),
      start_(mask_ + 1, 0),
      sums_(factors_.size()) {
    if (factors_.empty() || factors_.front() < 1 || 2 * factors_.back() > window) {
        throw DataError("window: " + std::to_string(window) +
                        " samples found, at least twice the largest averaging factor needed");
    }
    if (!(tau0 > 0)) {
        throw DataError("tau0: must be > 0, got " + std::to_string(tau0));
    }
}

void SlidingVariance::enter(std::size_t m, std::uint64_t end, double sign,
                            Sums& sums) const noexcept {
    const auto term = sign > 0 ? std::size_t{1} : std::size_t{0} - 1;
    const std::uint64_t reach = end - start_[end & mask_];
    if (reach < m) {
        return;
    }
    const double late = angle_[end & mask_] - angle_[(end - m) & mask_];
    sums.first += sign * late;
    sums.first_squares += sign * late * late;
    sums.firsts += term;
    if (reach < 2 * m) {
        return;
    }
    const double d = late - (angle_[(end - m) & mask_] - angle_[(end - 2 * m) & mask_]);
    sums.second += sign * d * d;
    sums.seconds += term;
}

void SlidingVariance::add(double rate) noexcept {
    const bool present = std::isfinite(rate);
    const double last = angle_[newest_ & mask_];
    const std::uint64_t start = start_[newest_ & mask_];
    ++newest_;
    angle_[newest_ & mask_] = present ? last + (rate - offset_) * tau0_ : last;
    start_[newest_ & mask_] = present ? start : newest_;
    missing_ += present ? 0 : 1;
    const bool leaves = newest_ > window_;
    const std::uint64_t gone = newest_ - window_ - 1;
    if (leaves && start_[(gone + 1) & mask_] == gone + 1) {
        --missing_;
    }
    for (std::size_t k = 0; k < factors_.size(); ++k) {
        const std::size_t m = factors_[k];
        Sums& sums = sums_[k];
        enter(m, newest_, 1.0, sums);
        if (!leaves) {
            continue;
        }
        // The differences that begin at the angle that leaves: a first one and a second one.
        if (start_[(gone + m) & mask_] <= gone) {
            const double early = angle_[(gone + m) & mask_] - angle_[gone & mask_];
            sums.first -= early;
            sums.first_squares -= early * early;
            --sums.firsts;
            if (start_[(gone + 2 * m) & mask_] <= gone) {
                const double d =
                    angle_[(gone + 2 * m) & mask_] - angle_[(gone + m) & mask_] - early;
                sums.second -= d * d;
                --sums.seconds;
            }
        }
        // Of nothing the sum is zero, whatever rounding has left of what was taken off it.
        if (sums.firsts == 0) sums.first = sums.first_squares = 0;
        if (sums.seconds == 0) sums.second = 0;
    }
    if (newest_ % window_ == 0) {
        recompute();
    }
}

void SlidingVariance::recompute() noexcept {
    const std::uint64_t from = oldest();
    // Below only what lies in the window may count, however long ago the last gap was.
    for (std::uint64_t i = from; i <= newest_; ++i) {
        start_[i & mask_] = std::max(start_[i & mask_], from);
    }
    for (int pass = 0; pass < 2; ++pass) {
        for (std::size_t k = 0; k < factors_.size(); ++k) {
            Sums exact;
            for (std::uint64_t i = from + 1; i <= newest_; ++i) {
                enter(factors_[k], i, 1.0, exact);
            }
            if (pass == 0) {
                const double scale = std::max(exact.second, 1e-300);
                const double error = std::abs(sums_[k].second - exact.second) / scale;
                faults_ += error > kLargestRelativeError ? 1 : 0;
            }
            sums_[k] = exact;
        }
        if (pass == 0) {
            // Angles relative to the oldest, without the mean rate: small numbers keep digits.
            const double found = mean();
            const double shift = std::isnan(found) ? 0 : found - offset_;
            double taken = angle_[from & mask_];
            for (std::uint64_t i = from; i <= newest_; ++i) {
                const bool edge = i > from && start_[i & mask_] != i;
                taken += edge ? shift * tau0_ : 0;
                angle_[i & mask_] -= taken;
            }
            offset_ += shift;
        }
    }
}

double SlidingVariance::mean() const noexcept {
    const double present = static_cast<double>(newest_ - oldest() - missing_);
    return present > 0
               ? offset_ + (angle_[newest_ & mask_] - angle_[oldest() & mask_]) / (present * tau0_)
               : kNothing;
}

double SlidingVariance::allan(std::size_t k) const noexcept {
    const double tau = static_cast<double>(factors_[k]) * tau0_;
    const Sums& sums = sums_[k];
    return sums.seconds > 0
               ? std::max(0.0, sums.second) / (2 * tau * tau * static_cast<double>(sums.seconds))
               : kNothing;
}

double SlidingVariance::allan(std::size_t k, WindowShape shape) const noexcept {
    if (shape == WindowShape::rectangular) return allan(k);
    const std::size_t m = factors_[k];
    const double tau = static_cast<double>(m) * tau0_;
    const std::uint64_t from = oldest();
    const auto length = static_cast<double>(newest_ - from);
    double squares = 0;
    double weights = 0;
    for (std::uint64_t i = from + 2 * m; i <= newest_; ++i) {
        // Nothing spans a gap.
        if (start_[i & mask_] > i - 2 * m) continue;
        const double w = weight_of(shape, static_cast<double>(i - m - from) / length);
        const double d =
            angle_[i & mask_] - 2 * angle_[(i - m) & mask_] + angle_[(i - 2 * m) & mask_];
        squares += w * d * d;
        weights += w;
    }
    return weights > 0 ? squares / (2 * tau * tau * weights) : kNothing;
}

double SlidingVariance::classical(std::size_t k, double mean) const noexcept {
    const double tau = static_cast<double>(factors_[k]) * tau0_;
    const Sums& sums = sums_[k];
    if (sums.firsts == 0) {
        return kNothing;
    }
    const auto n = static_cast<double>(sums.firsts);
    const double centre = mean - offset_;
    return std::max(0.0, sums.first_squares / (tau * tau * n) -
                             2 * centre * sums.first / (tau * n) + centre * centre);
}

template <typename Visit>
void SlidingVariance::each_part(const Visit& visit) const {
    const std::uint64_t from = oldest();
    for (std::uint64_t end = newest_ + 1; end > from + 1;) {
        const std::uint64_t begin = std::max(from, start_[(end - 1) & mask_]);
        visit(begin, end - 1);
        end = begin;
    }
}

SlidingVariance::Tiled SlidingVariance::tiled(std::size_t k) const noexcept {
    std::uint64_t first = oldest();
    std::uint64_t last = first;
    each_part([&](std::uint64_t begin, std::uint64_t end) {
        if (end - begin > last - first) {
            first = begin;
            last = end;
        }
    });
    const std::size_t m = factors_[k];
    const std::size_t tiles = (last - first) / m;
    if (tiles < 2) {
        return {};
    }
    const std::size_t covered = tiles * m;
    double sum = 0;
    for (std::uint64_t at = first; at + covered <= last; ++at) {
        const double mean =
            (angle_[(at + covered) & mask_] - angle_[at & mask_]) / static_cast<double>(tiles);
        for (std::uint64_t i = at; i < at + covered; i += m) {
            const double d = angle_[(i + m) & mask_] - angle_[i & mask_] - mean;
            sum += d * d;
        }
    }
    const double tau = static_cast<double>(m) * tau0_;
    const auto terms = static_cast<double>(tiles * (last - first - covered + 1));
    return {sum / (terms * tau * tau), covered};
}

double SlidingVariance::share(std::size_t k) const {
    const std::size_t m = factors_[k];
    const auto degrees = [m](std::size_t points) { return edf(Statistic::oadev, 0, points, m); };
    double terms = 0;
    double spread = 0;
    // As of a record with gaps (deviations()): Welch and Satterthwaite's rule joins the parts.
    each_part([&](std::uint64_t begin, std::uint64_t end) {
        if (end - begin < 2 * m) return;
        const auto here = static_cast<double>(end - begin + 1 - 2 * m);
        terms += here;
        spread += here * here / degrees(end - begin + 1);
    });
    return terms > 0 ? terms * terms / spread / degrees(window_ + 1) : 0;
}

}  // namespace vibrig::estimator::allan
