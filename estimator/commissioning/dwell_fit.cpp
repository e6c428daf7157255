// Rates of the angles = M (drift_sign h D - C (w_r + north, east)) at the middle of each dwell.
#include "estimator/commissioning/dwell_fit.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "estimator/filter/angles.hpp"
#include "estimator/filter/drift_model.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/linear_algebra.hpp"
#include "estimator/filter/parameters.hpp"
#include "estimator/identification/dwell_row.hpp"

namespace vibrig::estimator::commissioning {

namespace {

/// Of one rate, deg/h: what the model leaves, such as motion across the vertical.
constexpr double kModelSigma = 0.05;
/// Of a normal variate: false alarms once in 3 million times.
constexpr double kByChance = 5;
constexpr double kBiasSigma = 20, kSquareSigma = 2;
constexpr int kFitted = static_cast<int>(kParameters) + 2;

using Fitted = Eigen::Matrix<double, kFitted, 1>;
using FittedSquare = Eigen::Matrix<double, kFitted, kFitted>;

/// North and east of a level rig in the reference frame of one whose base may lean.
std::pair<Eigen::Vector3d, Eigen::Vector3d> horizontal(const Settings& settings) {
    const double elevation = settings.elevation_deg / kDegPerRad;
    const int up = settings.up.axis;
    Eigen::Vector3d north = Eigen::Vector3d::Zero(), east = Eigen::Vector3d::Zero();
    north[(up + 2) % 3] = std::cos(elevation);
    north[up] = -settings.up.sign * std::sin(elevation);
    east[(up + 1) % 3] = settings.up.sign;
    return {north, east};
}

Fitted prior_of(const RatePriors& priors) {
    Fitted sigma;
    for (std::size_t group = 0; group < kGroups; ++group)
        for (std::size_t j = 0; j < kGyros; ++j)
            sigma[static_cast<int>(internal_index(group, j))] = group == kDt   ? kBiasSigma
                                                                : group <= kDo ? priors.linear
                                                                               : kSquareSigma;
    sigma[kFitted - 2] = sigma[kFitted - 1] = priors.earth;
    return sigma;
}

double input_mean_of(const Settings& settings, const Fitted& x) {
    double sum = 0, count = 0;
    for (std::size_t j = 0; j < kGyros; ++j) {
        const SignedAxis& input = settings.gyro_axes[j][0];
        if (input.axis != static_cast<int>(j)) continue;
        sum += input.sign * x[static_cast<int>(internal_index(kDi, j))];
        count += 1;
    }
    return count > 0 ? sum / count : 0;
}

/// A dwell's rates: what they are made of, their weights and the drift's part.
struct DwellRates {
    Eigen::Matrix<double, 3, kFitted> g;
    Eigen::Vector3d rate;
    Eigen::Matrix3d variance, weight, drift;
};

/// Noise of the readings as it was found, of the gyros' random walk N (its slope over T:
/// N^2 1.2/T), and what the model leaves; docs/theory/uncertainty.md.
Eigen::Matrix3d variance_of(const Settings& settings, const DwellMean& dwell, const Pose& pose,
                            double time_factor) {
    const double hours = dwell.duration_s * time_factor / 3600;
    const double n = settings.gyro_random_walk_deg_per_rt_h;
    Eigen::Matrix3d variance = kModelSigma * kModelSigma * Eigen::Matrix3d::Identity();
    if (hours > 0) variance += n * n * 1.2 / hours * pose.m * pose.m.transpose();
    for (std::size_t k = 0; k < 3; ++k)
        variance(static_cast<int>(k), static_cast<int>(k)) +=
            dwell.slope_variance[k] / (time_factor * time_factor);
    return variance;
}

/// From one dwell's beginning to the next one's, h.
double between_h(const DwellMean& before, const DwellMean& after) {
    const double s = after.begin_s - before.begin_s;
    return (s >= before.duration_s ? s : before.duration_s + kAssumedPause_s) / 3600;
}

/// Beyond `normal`^-1: the bias walks from dwell to dwell, and all rates after a step of it have
/// it.
FittedSquare of_the_walk(const Settings& settings, const std::vector<DwellRates>& rates,
                         const std::vector<double>& hours, const FittedSquare& inverse) {
    const double q = std::pow(settings.drift.walk_deg_h_rt_h, 2);
    Eigen::Matrix<double, kFitted, 3> later = Eigen::Matrix<double, kFitted, 3>::Zero();
    FittedSquare sum = FittedSquare::Zero();
    for (std::size_t k = rates.size(); k-- > 1;) {
        later += rates[k].g.transpose() * rates[k].weight * rates[k].drift;
        sum += q * hours[k] * later * later.transpose();
    }
    return inverse * sum * inverse;
}

}  // namespace

double Verticals::apart_deg() const {
    return std::atan2(force.cross(encoders).norm(), force.dot(encoders)) * kDegPerRad;
}

std::vector<Verticals> verticals(const Settings& settings, const std::vector<DwellMean>& dwells) {
    const Kinematics kinematics(settings);
    std::vector<Verticals> all;
    for (const DwellMean& dwell : dwells) {
        Eigen::Vector3d force = Eigen::Vector3d::Zero();
        for (std::size_t i = 0; i < 3; ++i)
            for (std::size_t k = 0; k < 3; ++k)
                force[static_cast<int>(i)] += settings.accelerometer_matrix[i][k] *
                                              (dwell.force_g[k] - settings.accelerometer_zero_g[k]);
        all.push_back({force, kinematics.pose(kinematics.gimbal_angles(dwell.encoder_rad)).up});
    }
    return all;
}

namespace {

/// Rates of dwells whose level is known, with an inner angle at which they can be determined.
std::vector<DwellRates> rates_of(const Settings& settings, const std::vector<DwellMean>& dwells,
                                 double time_factor, std::vector<double>& hours) {
    const Kinematics kinematics(settings);
    const DriftModel model(settings);
    const auto [north, east] = horizontal(settings);
    std::vector<DwellRates> all;
    double since = 0;
    for (std::size_t n = 0; n < dwells.size(); ++n) {
        const DwellMean& dwell = dwells[n];
        if (n > 0) since += between_h(dwells[n - 1], dwell);
        if (!dwell.level_known) continue;
        const Pose pose = kinematics.pose(kinematics.gimbal_angles(dwell.encoder_rad));
        if (std::abs(pose.cos_beta) < std::cos(kMaxInnerAngleRad)) continue;
        const auto h = model.regressors(pose.up, dwell.kappa);
        DwellRates one;
        one.drift = model.drift_sign() * pose.m;
        for (std::size_t group = 0; group < kGroups; ++group)
            for (std::size_t j = 0; j < kGyros; ++j)
                one.g.col(static_cast<int>(internal_index(group, j))) =
                    h[group][j] * one.drift.col(static_cast<int>(j));
        one.g.col(kFitted - 2) = -pose.m * pose.c * north;
        one.g.col(kFitted - 1) = -pose.m * pose.c * east;
        for (std::size_t k = 0; k < 3; ++k)
            one.rate[static_cast<int>(k)] =
                settings.encoder_sign[k] * dwell.slope_deg_h[k] / time_factor;
        one.rate += pose.m * pose.earth_rate;
        one.variance = variance_of(settings, dwell, pose, time_factor);
        one.weight = one.variance.inverse();
        all.push_back(one);
        hours.push_back(since);
        since = 0;
    }
    return all;
}

/// chi-square per degree of freedom that noise exceeds once in 3 million times (Wilson, Hilferty).
double most_by_chance(double degrees) {
    const double v = 2 / (9 * degrees);
    return std::pow(1 - v + kByChance * std::sqrt(v), 3);
}

}  // namespace

RateFit fit_rates(const Settings& settings, const std::vector<DwellMean>& dwells,
                  const RatePriors& priors, double time_factor) {
    std::vector<double> hours;
    const auto rates = rates_of(settings, dwells, time_factor, hours);
    RateFit fit;
    fit.known = !rates.empty();
    FittedSquare normal = FittedSquare::Zero();
    Fitted right = Fitted::Zero();
    double all = 0, variance = 0;
    for (const DwellRates& one : rates) {
        normal += one.g.transpose() * one.weight * one.g;
        right += one.g.transpose() * one.weight * one.rate;
        all += one.rate.dot(one.weight * one.rate);
        variance += one.variance.trace() / 3 / static_cast<double>(rates.size());
    }
    normal.diagonal() += prior_of(priors).cwiseAbs2().cwiseInverse();
    const linear_algebra::PivotedCholesky solver(normal);
    const Fitted x = solver.solve(right);
    fit.cost = std::max(0.0, all - right.dot(x));
    fit.north = x[kFitted - 2];
    fit.east = x[kFitted - 1];
    fit.input_mean = input_mean_of(settings, x);
    const double degrees = std::max(3.0 * static_cast<double>(rates.size()) - kFitted, 1.0);
    fit.rest = std::sqrt(variance * fit.cost / degrees);
    fit.rest_by_chance = std::sqrt(variance * most_by_chance(degrees));
    // What scatters more than it should is not known better than it scatters.
    const double birge = std::max(1.0, fit.cost / degrees);
    const FittedSquare inverse = solver.solve(FittedSquare::Identity());
    const FittedSquare covariance = birge * inverse + of_the_walk(settings, rates, hours, inverse);
    for (const int i : {kFitted - 2, kFitted - 1}) {
        fit.sigma = std::max(fit.sigma, std::sqrt(covariance(i, i)));
        fit.dilution = std::max(fit.dilution, std::sqrt(inverse(i, i) / variance));
    }
    return fit;
}

}  // namespace vibrig::estimator::commissioning
