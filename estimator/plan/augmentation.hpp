#pragma once

#include <cstddef>
#include <vector>

namespace vibrig::estimator::plan {

/// A run as the whole identification sees it.
struct Experiment {
    /// Sensitivities of the run's results to the coefficients over the results' standard errors,
    /// row-major, as many columns as there are coefficients.
    std::vector<double> rows;
    double cost = 1;
};

struct Augmentation {
    std::vector<std::size_t> runs;  ///< numbers of experiments, the most informative per cost first
    std::vector<double> sigma;      ///< standard errors to be expected with them
    bool met = false;               ///< every target
};

/// Few and cheap runs that bring every coefficient's standard error from where `covariance` (row-
/// major) has it to its target (0: none), `at_most` of them: greedy choice, then exchange and
/// removal while the targets hold. Throws PlanError if sizes or values do not fit.
[[nodiscard]] Augmentation augment(const std::vector<double>& covariance,
                                   const std::vector<Experiment>& experiments,
                                   const std::vector<double>& target, std::size_t at_most);

/// Covariance, row-major, of coefficients with standard errors `prior` after each experiment was
/// run `done` times (empty: none of them).
[[nodiscard]] std::vector<double> covariance_after(const std::vector<double>& prior,
                                                   const std::vector<Experiment>& experiments,
                                                   const std::vector<double>& done);

}  // namespace vibrig::estimator::plan
