// Rates of the angles = M (drift_sign h D - C (w_r + north, east)) at the middle of each dwell.
#include "estimator/commissioning/dwell_fit.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "estimator/filter/drift_model.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/parameters.hpp"

namespace vibrig::estimator::commissioning {

namespace {

/// Of one rate, deg/h: what the model leaves; noise is below it.
constexpr double kRateSigma = 0.05;
constexpr double kBiasSigma = 20, kSquareSigma = 2;
constexpr double kDegPerRad = 180 / kPi;
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

RateFit fit_rates(const Settings& settings, const std::vector<DwellMean>& dwells,
                  const RatePriors& priors, double time_factor) {
    const Kinematics kinematics(settings);
    const DriftModel model(settings);
    const auto [north, east] = horizontal(settings);
    FittedSquare normal = FittedSquare::Zero();
    Fitted right = Fitted::Zero();
    double all = 0;
    int rates = 0;
    const double weight = 1 / (kRateSigma * kRateSigma);
    for (const DwellMean& dwell : dwells) {
        if (!dwell.level_known) continue;
        const Pose pose = kinematics.pose(kinematics.gimbal_angles(dwell.encoder_rad));
        if (std::abs(pose.cos_beta) < std::cos(kMaxInnerAngleRad)) continue;
        const auto h = model.regressors(pose.up, dwell.kappa);
        Eigen::Matrix<double, 3, kFitted> g;
        for (std::size_t group = 0; group < kGroups; ++group)
            for (std::size_t j = 0; j < kGyros; ++j)
                g.col(static_cast<int>(internal_index(group, j))) =
                    model.drift_sign() * h[group][j] * pose.m.col(static_cast<int>(j));
        g.col(kFitted - 2) = -pose.m * pose.c * north;
        g.col(kFitted - 1) = -pose.m * pose.c * east;
        Eigen::Vector3d rate;
        for (std::size_t k = 0; k < 3; ++k)
            rate[static_cast<int>(k)] =
                settings.encoder_sign[k] * dwell.slope_deg_h[k] / time_factor;
        rate += pose.m * pose.earth_rate;
        normal += weight * g.transpose() * g;
        right += weight * g.transpose() * rate;
        all += weight * rate.squaredNorm();
        rates += 3;
    }
    const Fitted prior = prior_of(priors);
    normal.diagonal() += prior.cwiseAbs2().cwiseInverse();
    const auto solver = normal.ldlt();
    const Fitted x = solver.solve(right);
    RateFit fit;
    fit.known = rates > 0;
    fit.cost = std::max(0.0, all - right.dot(x));
    fit.north = x[kFitted - 2];
    fit.east = x[kFitted - 1];
    for (const int i : {kFitted - 2, kFitted - 1})
        fit.sigma = std::max(fit.sigma, std::sqrt(solver.solve(Fitted::Unit(i))[i]));
    fit.rest = kRateSigma * std::sqrt(fit.cost / std::max(rates - kFitted, 1));
    fit.input_mean = input_mean_of(settings, x);
    return fit;
}

}  // namespace vibrig::estimator::commissioning
