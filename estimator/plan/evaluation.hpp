#pragma once

#include <string>
#include <vector>

#include "estimator/plan/model.hpp"

namespace vibrig::estimator::plan {

/// What a plan is worth before anything is measured. Sigmas are for unit noise and the whole
/// effort.
struct Evaluation {
    std::size_t coefficients = kTerms;  ///< of the model
    std::size_t rank = 0;
    double effort = 0;       ///< sum of effort * cost
    double condition = 0;    ///< of the information matrix, coefficients scaled to unit diagonal
    double log_det = 0;      ///< of the information per unit of effort; -infinity: rank deficient
    double trace = 0;        ///< A: sum of variances for unit effort
    double largest = 0;      ///< E: largest variance of a unit combination for unit effort
    Row sigma{};             ///< infinite where not determined; 0 for terms the model has not
    double correlation = 0;  ///< strongest of all pairs, with sign
    std::size_t first = 0, second = 0;  ///< the pair
    /// Combinations of coefficients on which no run of the plan depends.
    std::vector<Row> null_vectors;

    [[nodiscard]] bool identifies_all() const noexcept { return rank == coefficients; }
    /// Names of the coefficients that are not determined, "D0, D11, D22, D33".
    [[nodiscard]] std::string undetermined() const;
};

[[nodiscard]] Evaluation evaluate(const Problem& problem, const Effort& effort);

/// General equivalence theorem (Kiefer and Wolfowitz 1960): D-efficiency of the plan among all over
/// these points is at least p / max d. Zero for a rank-deficient plan.
[[nodiscard]] double equivalence_bound(const Problem& problem, const Effort& effort);

/// [det(plan) / det(optimum)]^(1/p), both per unit of effort.
[[nodiscard]] double d_efficiency(const Evaluation& plan, double optimal_log_det) noexcept;

struct Remedy {
    std::vector<std::size_t> points;  ///< one run each; empty if none of the points helps
    bool complete = false;            ///< with them the plan determines everything
};
/// Runs that raise the rank most, the cheapest among equals, until the plan determines everything.
/// `extra` has the same model as `problem`.
[[nodiscard]] Remedy cheapest_remedy(const Problem& problem, const Effort& effort,
                                     const std::vector<Point>& extra);

}  // namespace vibrig::estimator::plan
