#pragma once

#include <map>
#include <string>

#include "estimator/filter/parameters.hpp"
#include "estimator/identification/observability.hpp"

namespace vibrig::estimator {

/// What one run of the two-step route leaves behind: the filter with the squares along the output
/// axes fixed at zero.
struct RunSolution {
    double kappa = 1;        ///< mean over its dwells of the final 1 + a0^2 / 2
    ParameterArray value{};  ///< filter order
    Covariance covariance = Covariance::Zero();
};

/// Standard deviations that fix D_OO at zero, else the prior's.
[[nodiscard]] ParameterArray two_step_prior(const ParameterArray& prior) noexcept;

/// Recovery of all 30 coefficients from two runs (Tang et al. 2009, eqs 14-16, for any kappa):
/// everything of the run with the larger kappa, of the other only the constants. False, and `out`
/// untouched, if the two kappas are equal.
[[nodiscard]] bool recover(const RunSolution& first, const RunSolution& second,
                           RunSolution& out) noexcept;

/// Why the route cannot work with these runs, for people; empty: it can. Levels of the dwells of
/// each run, by its number.
[[nodiscard]] std::string two_step_obstacle(const std::map<int, KappaSpread>& runs);

}  // namespace vibrig::estimator
