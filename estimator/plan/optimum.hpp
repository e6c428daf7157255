#pragma once

#include <cstddef>

#include "estimator/plan/model.hpp"

namespace vibrig::estimator::plan {

struct Optimum {
    Effort share;        ///< of the effort (cost included), sums to 1
    double log_det = 0;  ///< of the information per unit of effort
    double gap = 0;      ///< max d - p
    double bound = 1;    ///< p / max d
    std::size_t iterations = 0;
};

inline constexpr double kGap = 1e-7;

/// D-optimal approximate design: vertex exchange, pairwise exchange within the support and the
/// multiplicative step in turn (Yu, Statistics and Computing 21, 2011, 475-481), until max d - p <
/// `gap`. Throws PlanError if the points do not determine the coefficients.
[[nodiscard]] Optimum d_optimum(const Problem& problem, double gap = kGap,
                                std::size_t most_iterations = 20000);

struct Bracket {
    double value = 0;        ///< reached
    double lower_bound = 0;  ///< no design over these points does better
};
/// Smallest sum of variances for unit effort (A).
[[nodiscard]] Bracket a_optimum(const Problem& problem);
/// Smallest largest variance for unit effort (E), from Kiefer's criterion with a high power: the
/// bounds stay a few percent apart.
[[nodiscard]] Bracket e_optimum(const Problem& problem);

}  // namespace vibrig::estimator::plan
