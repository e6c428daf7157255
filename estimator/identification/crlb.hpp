#pragma once

#include <array>
#include <vector>

#include "estimator/filter/settings.hpp"

namespace vibrig::estimator {

/// One dwell of a plan before it is run.
struct PlannedDwell {
    std::array<double, 3> angles_deg{};  ///< gimbal angles at its start: outer, inner, azimuth
    double kappa = 1;                    ///< 1 + a0^2 / 2, a0 at the platform in g
    double duration_s = 100;
    int run = 1;
};

/// Variance of one angle rate, (deg/h)^2, from a dwell whose rate is otherwise unknown. Here and
/// below `period_s` is the time between two samples; SettingsError if it is not above 0.
[[nodiscard]] double rate_variance(const Settings& settings, double duration_s, double period_s);

/// What one dwell tells, for a plan of dwells: sensitivities of the three angle rates to the
/// coefficients (order of parameter_names()) over the rates' standard error, row-major 3 x 30.
[[nodiscard]] std::vector<double> rate_rows(const Settings& settings, const PlannedDwell& dwell,
                                            const std::array<double, kParameters>& nominal,
                                            double period_s);

/// Cramer-Rao bounds (1 sigma, no prior) of the coefficients for a plan, in the order of
/// parameter_names(); infinite where the plan does not determine a coefficient. `nominal` (same
/// order) moves the platform to where it is in the middle of each dwell.
[[nodiscard]] std::array<double, kParameters> predicted_sigma(
    const Settings& settings, const std::vector<PlannedDwell>& plan,
    const std::array<double, kParameters>& nominal, double period_s);

/// Time between the samples of a recording: the median of the intervals between these stamps, s, so
/// that lost samples do not stretch it. 0 with fewer than two. Reorders what it is given.
[[nodiscard]] double median_interval(std::vector<double>& times_s);

}  // namespace vibrig::estimator
