#include "estimator/commissioning/consistency.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/commissioning/dwell_fit.hpp"
#include "estimator/filter/angles.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/settings_check.hpp"
#include "estimator/filter/text.hpp"

namespace vibrig::estimator::commissioning {

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

namespace {

void hold_rates_against(const ConsistencyLimits& limits, const RateFit& fit, Consistency& c) {
    const double allowed = std::max(limits.earth_deg_h, 5 * c.sigma_deg_h);
    const auto contradict = [&c](std::string what) { c.contradictions.push_back(std::move(what)); };
    if (std::abs(c.north_deg_h) > allowed || std::abs(c.east_deg_h) > allowed)
        contradict(
            text("Earth rate %.2f deg/h north, %.2f deg/h east off what the site's keys "
                 "say (%.2f allowed)",
                 c.north_deg_h, c.east_deg_h, allowed));
    const double left = std::max(limits.rest_deg_h, fit.rest_by_chance);
    if (fit.rest > left)
        contradict(
            text("rates fit no coefficients: %.3g deg/h left, %.3g allowed", fit.rest, left));
    if (std::abs(c.input_mean_deg_h_g) > limits.input_mean_deg_h_g)
        contradict(
            text("mean of the three input-axis terms %.1f deg/h/g, %g allowed: sign of "
                 "site.latitude_deg, platform.drift_sign?",
                 c.input_mean_deg_h_g, limits.input_mean_deg_h_g));
}

}  // namespace

Consistency consistency(const Settings& settings, const std::vector<DwellMean>& dwells,
                        const ConsistencyLimits& limits) {
    check(settings);
    Consistency c;
    for (const Verticals& v : verticals(settings, dwells))
        c.gravity_deg = std::max(c.gravity_deg, v.apart_deg());
    if (!(c.gravity_deg <= limits.gravity_deg))
        c.contradictions.push_back(
            text("mean force %.2f deg off the vertical by the encoders, %g allowed", c.gravity_deg,
                 limits.gravity_deg));
    const auto usable = static_cast<std::size_t>(
        std::ranges::count_if(dwells, [](const DwellMean& dwell) { return dwell.level_known; }));
    if (usable < limits.dwells) return c;
    const RateFit fit = fit_rates(settings, dwells, {});
    // Few attitudes leave the Earth's rate to the coefficients: then nothing is said of it.
    constexpr double kObservable = 10;
    if (!fit.known || !(fit.dilution < kObservable)) return c;
    c.earth_known = true;
    c.north_deg_h = fit.north;
    c.east_deg_h = fit.east;
    c.sigma_deg_h = fit.sigma;
    c.rest_deg_h = fit.rest;
    c.input_mean_deg_h_g = fit.input_mean;
    hold_rates_against(limits, fit, c);
    return c;
}

}  // namespace vibrig::estimator::commissioning
