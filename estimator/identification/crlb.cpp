#include "estimator/identification/crlb.hpp"

#include <cmath>
#include <limits>
#include <string>

#include "estimator/filter/angles.hpp"
#include "estimator/filter/drift_filter.hpp"
#include "estimator/filter/median.hpp"
#include "estimator/filter/settings_check.hpp"
#include "estimator/identification/observability.hpp"
#include "estimator/identification/planned_covariance.hpp"

namespace vibrig::estimator {
namespace {

/// A direction with less than this share of the largest information, prior units, is not determined
/// at all.
constexpr double kNoInformation = 1e-10;
constexpr double kUndeterminedShare = 1e-3;

using Matrix3x30 = Eigen::Matrix<double, 3, kParameters>;

/// Sensitivity of the three angle rates to the parameters at mid-dwell, filter order.
Matrix3x30 sensitivity(const Kinematics& kinematics, const DriftModel& model,
                       const PlannedDwell& dwell, const ParameterArray& nominal) {
    Eigen::Vector3d angles(dwell.angles_deg[0], dwell.angles_deg[1], dwell.angles_deg[2]);
    angles *= kRadPerDeg;
    const Pose start = kinematics.pose(angles);
    const Regressors at_start = model.regressors(start.up, dwell.kappa);
    const Eigen::Vector3d rate = start.m * model.platform_rate(start, at_start, nominal.data());
    const Pose middle = kinematics.pose(angles + rate * (0.5 * dwell.duration_s / kArcsecPerRad));
    const Regressors h = model.regressors(middle.up, dwell.kappa);
    Matrix3x30 g;
    for (std::size_t group = 0; group < kGroups; ++group) {
        for (std::size_t j = 0; j < kGyros; ++j) {
            g.col(static_cast<Eigen::Index>(internal_index(group, j))) =
                model.drift_sign() * h[group][j] * middle.m.col(static_cast<Eigen::Index>(j));
        }
    }
    return g;
}

Covariance information_in_prior_units(const Settings& settings,
                                      const std::vector<PlannedDwell>& plan,
                                      const ParameterArray& nominal, const ParameterArray& prior,
                                      double period_s) {
    const Kinematics kinematics(settings);
    const DriftModel model(settings);
    const Eigen::Map<const Eigen::Matrix<double, kParameters, 1>> scale(prior.data());
    Covariance information = Covariance::Zero();
    for (const PlannedDwell& dwell : plan) {
        const Matrix3x30 g = sensitivity(kinematics, model, dwell, nominal) * scale.asDiagonal();
        information +=
            linear_algebra::gram(g) / rate_variance(settings, dwell.duration_s, period_s);
    }
    return information;
}

}  // namespace

double rate_variance(const Settings& settings, double duration_s, double period_s) {
    if (!(period_s > 0) || !std::isfinite(period_s)) {
        throw SettingsError("sample period: found " + std::to_string(period_s) +
                            " s, expected more than 0");
    }
    const FilterNoise noise = FilterNoise::of(settings);
    // Angle and rate: the first sample gives the angle, the rate starts without a prior worth the
    // name.
    double paa = noise.angle_variance, par = 0, prr = 1e10;
    const auto steps = static_cast<long>(std::lround(duration_s / period_s)) - 1;
    for (long n = 0; n < steps; ++n) {
        paa += 2.0 * period_s * par + period_s * period_s * prr + noise.walk * period_s;
        par += period_s * prr;
        const double s = paa + noise.angle_variance;
        prr -= par * par / s;
        par *= noise.angle_variance / s;
        paa *= noise.angle_variance / s;
    }
    return prr;
}

std::vector<double> rate_rows(const Settings& settings, const PlannedDwell& dwell,
                              const std::array<double, kParameters>& nominal, double period_s) {
    ParameterArray in_order{};
    for (std::size_t i = 0; i < kParameters; ++i) in_order[internal_of(i)] = nominal[i];
    const Matrix3x30 g = sensitivity(Kinematics(settings), DriftModel(settings), dwell, in_order) /
                         std::sqrt(rate_variance(settings, dwell.duration_s, period_s));
    std::vector<double> rows;
    for (Eigen::Index r = 0; r < g.rows(); ++r) {
        for (std::size_t i = 0; i < kParameters; ++i) {
            rows.push_back(g(r, static_cast<Eigen::Index>(internal_of(i))));
        }
    }
    return rows;
}

std::array<double, kParameters> predicted_sigma(const Settings& settings,
                                                const std::vector<PlannedDwell>& plan,
                                                const std::array<double, kParameters>& nominal,
                                                double period_s) {
    check(settings);
    ParameterArray in_order{};
    for (std::size_t i = 0; i < kParameters; ++i) in_order[internal_of(i)] = nominal[i];

    const ParameterArray prior = prior_sigma(settings);
    const Eigen::Map<const Eigen::Matrix<double, kParameters, 1>> scale(prior.data());
    const Covariance information =
        information_in_prior_units(settings, plan, in_order, prior, period_s);
    const auto eigen = linear_algebra::covariance_eigen(information);
    const double least = kNoInformation * eigen.values.maxCoeff();
    std::array<double, kParameters> sigma{};
    for (std::size_t i = 0; i < kParameters; ++i) {
        const auto row = static_cast<Eigen::Index>(internal_of(i));
        double variance = 0;
        for (Eigen::Index k = 0; k < eigen.values.size(); ++k) {
            const double share = eigen.vectors(row, k);
            const double value = eigen.values[k];
            if (value > least) {
                variance += share * share / value;
            } else if (std::abs(share) > kUndeterminedShare) {
                variance = std::numeric_limits<double>::infinity();
            }
        }
        sigma[i] = scale[row] * std::sqrt(variance);
    }
    return sigma;
}

Covariance planned_covariance(const Settings& settings, const std::vector<PlannedDwell>& plan,
                              double period_s) {
    check(settings);
    const ParameterArray prior = prior_sigma(settings);
    const Eigen::Map<const Eigen::Matrix<double, kParameters, 1>> scale(prior.data());
    const Covariance information =
        information_in_prior_units(settings, plan, ParameterArray{}, prior, period_s) +
        Covariance::Identity();
    return scale.asDiagonal() * linear_algebra::covariance_inverse(information) *
           scale.asDiagonal();
}

double median_interval(std::vector<double>& times_s) {
    if (times_s.size() < 2) return 0;
    for (std::size_t i = 0; i + 1 < times_s.size(); ++i) times_s[i] = times_s[i + 1] - times_s[i];
    times_s.pop_back();
    return median(times_s);
}

}  // namespace vibrig::estimator
