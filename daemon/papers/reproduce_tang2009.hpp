#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "daemon/papers/reproduce.hpp"
#include "estimator/filter/settings.hpp"

namespace vibrig::tool::tang2009 {

using Coefficients = std::array<double, estimator::kParameters>;  ///< as parameter_names()

/// The ways of identification that are compared, with the table levels of their runs.
enum Route : std::size_t {
    kTwoStep1,  ///< trial 1: 9 and 7 g, the paper's route
    kJoint1,
    kTwoStep2,  ///< trial 2: 0 and 2 g
    kJoint2,
    kOneLevel3,   ///< trial 3: 9 g alone, all 30 coefficients at once, amplitude by eq. 13
    kJointRest,   ///< 9 and 0 g
    kJointLevel,  ///< 9 g alone, the joint filter
    kRoutes
};

struct Outcome {
    Coefficients value{}, sigma{};
    std::array<Coefficients, estimator::kParameters> covariance{};  ///< NaN: not determined
    double nees = 0;  ///< of the 30 coefficients; NaN where they are not all determined
    double nis = 0;   ///< mean per degree of freedom
    /// Sum of the squared correlations between all coefficients; 30: none correlate.
    double correlation_square = 0;
};

/// Estimates of a route every 10 s of its dwells, one seed.
struct Convergence {
    std::vector<double> minutes;
    std::vector<Coefficients> value;
};

/// All routes over simulated rigs at `scale` times the paper's levels (9, 7, 0 and 2 g at the
/// table; two thirds of it at the platform).
struct Study {
    double scale = 1;
    std::vector<std::array<Outcome, kRoutes>> seeds;
    std::array<Convergence, kRoutes> convergence;  ///< of the first seed
    Coefficients bound{}, bound_trial_2{};         ///< Cramer-Rao, 1 sigma

    [[nodiscard]] double platform_g(double table_g) const { return scale * table_g * 2.0 / 3.0; }
};

[[nodiscard]] const Coefficients& truth();
/// One study for each scale; every seed is a rig of its own, seeds 1 ... n.
[[nodiscard]] std::vector<Study> run_studies(const std::vector<double>& scales, std::size_t seeds);

/// Charts like the paper's Figure 3, one for each trial, gyro and route of a study.
void add_convergence(const Study& study, Reproduction& table);
/// Eqs 3-7: transmission of the isolators and its transient, against the integrated equation 1.
void add_transmission(Reproduction& table);
/// Section 3.5: what errors of the accelerometers do to the level.
void add_level_errors(Reproduction& table);

}  // namespace vibrig::tool::tang2009
