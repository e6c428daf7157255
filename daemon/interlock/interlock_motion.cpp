#include "daemon/interlock/interlock_motion.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/filter/angles.hpp"

namespace vibrig::rt {

void MotionMonitor::add(const drivers::Sample& sample) noexcept {
    if (!(time_constant_s_ > 0)) return;
    const Vector& f = sample.force;
    if (last_ == 0) {
        first_ = last_ = sample.time;
        mean_ = f;
        return;
    }
    const double dt = drivers::to_seconds(sample.time - last_);
    if (!(dt > 0)) return;
    last_ = sample.time;
    const double age = drivers::to_seconds(sample.time - first_);
    // As a plain mean at first, so that the first sample has no lasting weight.
    const double weight = dt / std::clamp(age, dt, std::max(dt, time_constant_s_));
    Vector away{};
    for (std::size_t i = 0; i < 3; ++i) {
        away[i] = f[i] - mean_[i];
        mean_[i] += weight * away[i];
    }
    const std::array<double, 6> product{away[0] * away[0], away[1] * away[1], away[2] * away[2],
                                        away[0] * away[1], away[0] * away[2], away[1] * away[2]};
    for (std::size_t i = 0; i < product.size(); ++i)
        covariance_[i] += weight * (product[i] - covariance_[i]);
    if (!known_ && age >= 2 * time_constant_s_) {
        reference_ = mean_;
        known_ = true;
    }
}

double MotionMonitor::cross_share() const noexcept {
    if (!known_) return -1;
    const auto& [x, y, z] = mean_;
    const auto& c = covariance_;
    const double length2 = x * x + y * y + z * z;
    const double along = (x * x * c[0] + y * y * c[1] + z * z * c[2] +
                          2 * (x * y * c[3] + x * z * c[4] + y * z * c[5])) /
                         length2;
    if (!(along >= kLeastAxial_g * kLeastAxial_g)) return -1;
    return std::sqrt(std::max(0.0, c[0] + c[1] + c[2] - along) / along);
}

double MotionMonitor::tilt_deg() const noexcept {
    if (!known_) return -1;
    const auto& a = reference_;
    const auto& b = mean_;
    const double cross =
        std::hypot(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]);
    const double dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    return std::atan2(cross, dot) * estimator::kDegPerRad;
}

void LossMonitor::add(drivers::Time now, std::uint64_t samples, std::uint64_t incomplete,
                      std::uint64_t gaps) noexcept {
    if (filled_ > 0 && now - taken_ < drivers::kSecond) return;
    taken_ = now;
    const Totals totals{samples + gaps, incomplete + gaps};
    const Totals& oldest = past_[filled_ < kSeconds ? 0 : next_];
    percent_ = filled_ == 0 || totals.due == oldest.due
                   ? 0
                   : 100 * static_cast<double>(totals.bad - oldest.bad) /
                         static_cast<double>(totals.due - oldest.due);
    past_[next_] = totals;
    next_ = (next_ + 1) % kSeconds;
    filled_ = std::min(filled_ + 1, kSeconds);
}

}  // namespace vibrig::rt
