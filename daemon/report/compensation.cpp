#include "daemon/report/compensation.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/filter/angles.hpp"
#include "estimator/filter/drift_model.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/mapped.hpp"
#include "estimator/filter/parameters.hpp"
#include "estimator/filter/second_moment.hpp"

namespace vibrig::report {

using estimator::kGroups;
using estimator::kParameters;

Coefficients combined(const estimator::uncertainty::Assessment& assessed,
                      const Coefficients& otherwise) {
    if (!assessed.done) return otherwise;
    Coefficients out = otherwise;
    out.combined = true;
    const auto known = [&](std::size_t i) {
        return otherwise.observable[i] && std::isfinite(assessed.coefficients[i].u);
    };
    for (std::size_t i = 0; i < kParameters; ++i) {
        if (!known(i)) continue;
        out.value[i] = assessed.coefficients[i].value;
        out.sigma[i] = assessed.coefficients[i].u;
        for (std::size_t j = 0; j < kParameters; ++j) {
            if (known(j))
                out.covariance[i * kParameters + j] = assessed.covariance_combined(
                    static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
        }
    }
    return out;
}

Prediction predict(const estimator::Settings& settings, const Coefficients& of,
                   const std::array<double, 3>& attitude_deg,
                   const estimator::VibrationMoment& vibration) {
    const estimator::Kinematics kinematics(settings);
    const estimator::DriftModel model(settings);
    const auto pose = kinematics.pose(estimator::mapped(attitude_deg) * estimator::kRadPerDeg);
    const auto h = model.regressors(pose.up, estimator::second_moment(pose, vibration));
    Prediction out;
    for (std::size_t gyro = 0; gyro < 3; ++gyro) {
        const auto weight = [&](std::size_t k) { return h[estimator::kPublicGroup[k]][gyro]; };
        double variance = 0;
        for (std::size_t k = 0; k < kGroups; ++k) {
            const std::size_t i = gyro * kGroups + k;
            out.drift_dph[gyro] += weight(k) * of.value[i];
            if (!of.observable[i] && std::abs(weight(k)) > 1e-9) out.determined[gyro] = false;
            for (std::size_t l = 0; l < kGroups; ++l) {
                const std::size_t j = gyro * kGroups + l;
                variance += weight(k) * of.covariance[i * kParameters + j] * weight(l);
            }
        }
        out.residual_dph[gyro] = std::sqrt(std::max(0.0, variance));
    }
    return out;
}

}  // namespace vibrig::report
