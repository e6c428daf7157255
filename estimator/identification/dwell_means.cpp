#include "estimator/identification/dwell_means.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/filter/angles.hpp"
#include "estimator/filter/kinematics.hpp"

namespace vibrig::estimator {

void DwellMeans::add(const Measurement& m) noexcept {
    double all = m.time_s;
    for (std::size_t i = 0; i < 3; ++i) all += m.angle_rad[i] + m.force_g[i];
    if (!m.angles_good || !m.force_good || !std::isfinite(all)) return;
    if (count_ == 0) {
        first_s_ = m.time_s;
        first_ = last_ = m.angle_rad;
    }
    const double t = m.time_s - first_s_;
    count_ += 1;
    last_s_ = m.time_s;
    t_ += t;
    tt_ += t * t;
    for (std::size_t i = 0; i < 3; ++i) {
        last_[i] = wrap_next_to(m.angle_rad[i], last_[i]);
        const double a = last_[i] - first_[i];
        a_[i] += a;
        aa_[i] += a * a;
        ta_[i] += t * a;
        force_[i] += m.force_g[i];
    }
}

bool DwellMeans::known() const noexcept { return count_ >= 20 && tt_ * count_ > t_ * t_; }

DwellMean DwellMeans::mean(double kappa, bool level_known) const noexcept {
    DwellMean mean;
    mean.kappa = kappa;
    mean.level_known = level_known;
    mean.begin_s = first_s_;
    mean.duration_s = last_s_ - first_s_;
    constexpr double kDegPerHourOfRadPerS = 1 / kDegPerHour;
    const double spread = tt_ - t_ * t_ / count_;  // of the times about their mean
    for (std::size_t i = 0; i < 3; ++i) {
        mean.encoder_rad[i] = first_[i] + a_[i] / count_;
        const double slope = (ta_[i] - t_ * a_[i] / count_) / spread;
        mean.slope_deg_h[i] = kDegPerHourOfRadPerS * slope;
        const double scatter = aa_[i] - a_[i] * a_[i] / count_ - slope * slope * spread;
        mean.slope_variance[i] = kDegPerHourOfRadPerS * kDegPerHourOfRadPerS *
                                 std::max(0.0, scatter) / (count_ - 2) / spread;
        mean.force_g[i] = force_[i] / count_;
    }
    return mean;
}

}  // namespace vibrig::estimator
