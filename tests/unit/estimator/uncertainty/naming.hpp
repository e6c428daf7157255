#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "estimator/filter/declared.hpp"
#include "estimator/filter/parameters.hpp"
#include "tests/unit/estimator/uncertainty/theory_rows.hpp"

namespace vibrig::estimator::testing {

/// What theory says of a misfit before any campaign is simulated (docs/theory/uncertainty.md, "What
/// can be named").
struct Naming {
    std::array<double, kParameters> shift{};  ///< of the coefficients, in sigma
    double chi_square = 0;                    ///< F, by which it shows in the null fit
    Eigen::VectorXd rates;                    ///< what it adds to the dwells' rates, deg/h
    double probability = 0;  ///< that the odds for its class, at its own place, are above exp(4)
};

/// `unknowns`: of the class, in its unit, as signatures() lists them.
[[nodiscard]] Naming naming(const std::vector<PlannedRow>& plan, uncertainty::Misfit misfit,
                            const std::vector<double>& unknowns, int after_dwell = 0);

/// So many of `trials` happen at least, but for once in a thousand times.
[[nodiscard]] int least_of(int trials, double probability);

}  // namespace vibrig::estimator::testing
