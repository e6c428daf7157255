#pragma once

#include <array>
#include <vector>

#include "estimator/filter/settings.hpp"
#include "estimator/uncertainty/assessment.hpp"

namespace vibrig::report {

/// Coefficients as they are at the end of a campaign.
struct Coefficients {
    std::array<double, estimator::kParameters> value{}, sigma{};
    std::array<bool, estimator::kParameters> observable{};
    std::vector<double> covariance;  ///< 30 x 30, row-major, order of parameter_names()
    /// `sigma` is the standard uncertainty u, and `covariance` the combined one; else both are of
    /// the filter's noise alone.
    bool combined = false;
};

/// With a bias that may have moved and the declared inputs: the combined covariance, whole, of all
/// that is determined. What is not stays as `otherwise` has it; without an assessment, all.
[[nodiscard]] Coefficients combined(const estimator::uncertainty::Assessment& assessed,
                                    const Coefficients& otherwise);

/// Drift of the three gyros at one attitude under one vibration.
struct Prediction {
    std::array<double, 3> drift_dph{};     ///< without compensation, deg/h
    std::array<double, 3> residual_dph{};  ///< 1 sigma of what is left after it, deg/h
    /// It rests on coefficients that the data do not determine: sigma is the prior's there.
    std::array<bool, 3> determined{{true, true, true}};
};

/// Drift h . D of eqs 8-9 of Tang et al. 2009 with k1 = 1, k2 = kappa, and sqrt(h' P h) of the
/// coefficients' covariance; gimbal angles in deg, kappa = 1 + a^2 / 2 with a in g at the
/// platform.
[[nodiscard]] Prediction predict(const estimator::Settings& settings, const Coefficients& of,
                                 const std::array<double, 3>& attitude_deg,
                                 const estimator::VibrationMoment& vibration);

}  // namespace vibrig::report
