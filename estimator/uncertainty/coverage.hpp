#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "estimator/filter/declared.hpp"
#include "estimator/identification/dwell_row.hpp"
#include "estimator/uncertainty/assessment.hpp"

/// What makes of a coefficient's parts its U: for coefficients at one frequency and over several.
namespace vibrig::estimator::uncertainty {

/// Change of the 30 coefficients per relative change of local gravity, from their values; filter
/// order. Linear terms go with g, quadratic ones with its square.
[[nodiscard]] Eigen::VectorXd per_gravity(const Eigen::VectorXd& value);

/// What no dwell shows of the 30, filter order: gravity known to u(local_g), and, where the
/// platform is declared to move in step with the vibration, up to `sync_bound` on the quadratic
/// ones, deg/h/g^2.
[[nodiscard]] Eigen::MatrixXd unseen_covariance(const Inputs& inputs, const Eigen::VectorXd& value,
                                                double sync_bound);
/// The same of coefficient `internal`, as parts of its budget.
void add_unseen(const Inputs& inputs, const Eigen::VectorXd& value, double sync_bound,
                std::size_t internal, std::vector<Contribution>& budget);

/// Sets what correlations add to the variance of a coefficient and to the parts of its budget,
/// which begins with noise and drift states, then the inputs in their order.
void add_correlations(const std::vector<Correlated>& inputs, Coefficient& c);

/// Sorts the budget of coefficient `internal`, and sets nu_eff by Welch and Satterthwaite, k,
/// expanded and u_use, from noise, u_a, u and the budget. `spare`: dwells more than coefficients
/// fitted to them; `growth`: of the bias from a dwell's begin to its end, deg/h.
/// docs/theory/uncertainty.md.
void expand(const Inputs& inputs, std::size_t internal, double spare, double growth,
            Coefficient& c);

/// By how much the bias grows in a dwell of mean length, deg/h: `ramp` in deg/h per 100 s.
[[nodiscard]] double growth_in_dwell(double ramp, std::span<const DwellRow> rows);

}  // namespace vibrig::estimator::uncertainty
