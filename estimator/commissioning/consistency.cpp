#include "estimator/commissioning/consistency.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/commissioning/dwell_fit.hpp"
#include "estimator/filter/angles.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/settings_check.hpp"
#include "estimator/filter/text.hpp"

namespace vibrig::estimator::commissioning {

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
