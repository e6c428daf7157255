// Rates of the angles = M (D + G u - C (w_r + north, east)), as in earth.cpp. With the azimuth axis
// upright u hardly changes from drift to drift: G matters where a wrong zero has turned it.
#include "estimator/commissioning/opening.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "estimator/commissioning/dwell_fit.hpp"
#include "estimator/commissioning/suspect_search.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/linear_algebra.hpp"
#include "estimator/filter/settings_check.hpp"
#include "estimator/filter/text.hpp"

namespace vibrig::estimator::commissioning {

namespace {

constexpr int kAtRest = 14;  // north, east; D; G by rows
using AtRest = Eigen::Matrix<double, kAtRest, 1>;
using AtRestSquare = Eigen::Matrix<double, kAtRest, kAtRest>;

/// deg/h, 1 sigma: of D where it is measured, and where a configuration is weighed.
constexpr double kAnyDrift = 200, kUsualDrift = 3;
constexpr double kAnyEarth = 1e3, kSiteEarth = 1e-3;
constexpr double kUsualLinear = 2;  // deg/h/g

struct RestFit {
    AtRest x = AtRest::Zero();
    double sigma = 0, cost = 0, vertical = 0;
    int drifts = 0;
};

RestFit fit_rest(const Settings& settings, const std::vector<DwellMean>& stops, double rate_sigma,
                 double earth_sigma, double drift_sigma, double time_factor) {
    const Kinematics kinematics(settings);
    AtRestSquare normal = AtRestSquare::Zero();
    AtRest right = AtRest::Zero(), vertical = AtRest::Zero();
    double all = 0;
    RestFit fit;
    const double weight = 1 / (rate_sigma * rate_sigma);
    for (const DwellMean& stop : stops) {
        if (!stop.level_known) continue;
        const Pose pose = kinematics.pose(kinematics.gimbal_angles(stop.encoder_rad));
        if (std::abs(pose.cos_beta) < std::cos(kMaxInnerAngleRad)) continue;
        Eigen::Matrix<double, 3, kAtRest> g;
        g.col(0) = -pose.m * pose.level.col(0);
        g.col(1) = -pose.m * pose.level.col(2);
        g.middleCols<3>(2) = pose.m;
        for (int gyro = 0; gyro < 3; ++gyro)
            for (int k = 0; k < 3; ++k) g.col(5 + 3 * gyro + k) = pose.m.col(gyro) * pose.up[k];
        Eigen::Vector3d rate;
        for (std::size_t k = 0; k < 3; ++k)
            rate[static_cast<int>(k)] =
                settings.encoder_sign[k] * stop.slope_deg_h[k] / time_factor;
        rate += pose.m * pose.earth_rate;
        normal += weight * g.transpose() * g;
        right += weight * g.transpose() * rate;
        all += weight * rate.squaredNorm();
        vertical.segment<3>(2) += pose.up;
        for (int gyro = 0; gyro < 3; ++gyro)
            vertical.segment<3>(5 + 3 * gyro) += pose.up[gyro] * pose.up;
        ++fit.drifts;
    }
    if (fit.drifts == 0) return fit;
    for (int i = 0; i < kAtRest; ++i)
        normal(i, i) += std::pow(i < 2 ? earth_sigma : i < 5 ? drift_sigma : kUsualLinear, -2);
    const linear_algebra::PivotedCholesky solver(normal);
    fit.x = solver.solve(right);
    fit.cost = std::max(0.0, all - right.dot(fit.x));
    for (int i = 0; i < 2; ++i)
        fit.sigma = std::max(fit.sigma, std::sqrt(solver.solve(AtRest::Unit(i))(i, 0)));
    fit.vertical = fit.x.dot(vertical) / fit.drifts;
    return fit;
}

void hold_earth_against(const OpeningLimits& limits, Opening& o) {
    if (!(o.sigma_deg_h <= limits.known_deg_h))
        o.refused.push_back(
            text("free drift tells north and east to %.2g deg/h only: the readings are not those "
                 "of the positions",
                 o.sigma_deg_h));
    const double off = std::max(std::abs(o.north_deg_h), std::abs(o.east_deg_h));
    const double warned = std::max(limits.warn_deg_h, 5 * o.sigma_deg_h);
    const double refused = std::max(limits.refused_deg_h, 5 * o.sigma_deg_h);
    if (!(off <= warned)) {
        const auto found = text(
            "Earth rate %.2f deg/h north, %.2f deg/h east off what the site's keys give (warned "
            "above %.2f, refused above %.2f)",
            o.north_deg_h, o.east_deg_h, warned, refused);
        (off <= refused ? o.warned : o.refused).push_back(found);
    }
    if (!(o.rest_chi2 <= limits.rest_chi2))
        o.refused.push_back(text("free drift fits no Earth rate: chi2 %.3g, %g allowed",
                                 o.rest_chi2, limits.rest_chi2));
    const double vertical = std::abs(o.vertical_deg_h);
    if (!(vertical <= limits.warn_vertical_deg_h))
        (vertical <= limits.refused_vertical_deg_h ? o.warned : o.refused)
            .push_back(text("drift about the vertical %.1f deg/h (warned above %g, refused above "
                            "%g): sign of site.latitude_deg?",
                            o.vertical_deg_h, limits.warn_vertical_deg_h,
                            limits.refused_vertical_deg_h));
}

}  // namespace

Opening hold_at_rest(const Settings& settings, const std::vector<DwellMean>& stops,
                     const OpeningLimits& limits) {
    check(settings);
    Opening o;
    for (const Verticals& v : verticals(settings, stops))
        o.gravity_deg = std::max(o.gravity_deg, v.apart_deg());
    if (!(o.gravity_deg <= limits.warn_deg))
        (o.gravity_deg <= limits.refused_deg ? o.warned : o.refused)
            .push_back(text("mean force %.2f deg off the vertical by the encoders (warned above "
                            "%g, refused above %g)",
                            o.gravity_deg, limits.warn_deg, limits.refused_deg));
    const RestFit fit = fit_rest(settings, stops, limits.rate_sigma, kAnyEarth, kAnyDrift, 1);
    if (fit.drifts < 3) return o;
    o.earth_known = true;
    o.north_deg_h = fit.x[0];
    o.east_deg_h = fit.x[1];
    o.sigma_deg_h = fit.sigma;
    o.rest_chi2 = fit.cost;
    o.vertical_deg_h = fit.vertical;
    hold_earth_against(limits, o);
    return o;
}

std::vector<Suspect> suspects_at_rest(const Settings& settings, const std::vector<DwellMean>& stops,
                                      const OpeningLimits& limits, std::size_t most) {
    Judge judge;
    // The wrong key has brought the platform elsewhere: what drift terms make of that is left.
    auto elsewhere = limits;
    elsewhere.known_deg_h = HUGE_VAL;
    judge.fits = [elsewhere](const Settings& s, const std::vector<DwellMean>& at) {
        return hold_at_rest(s, at, elsewhere).refused.empty();
    };
    judge.rates = [&stops, &limits](const Settings& s, double time_factor) {
        return fit_rest(s, stops, limits.rate_sigma, kSiteEarth, kUsualDrift, time_factor).cost;
    };
    judge.gravity_deg = limits.refused_deg;
    judge.earth = hold_at_rest(settings, stops, limits).earth_known;
    return search_suspects(settings, stops, judge, most);
}

}  // namespace vibrig::estimator::commissioning
