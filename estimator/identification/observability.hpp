#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "estimator/filter/linear_algebra.hpp"
#include "estimator/filter/parameters.hpp"
#include "estimator/identification/result.hpp"

namespace vibrig::estimator {

/// How far the vibration levels of the dwells are apart.
struct KappaSpread {
    double mean = 0, least = 0, largest = 0;
    std::size_t dwells = 0;

    void add(double kappa) noexcept;
    /// All within 2 % of their mean: the squares cannot be distinguished from the constant,
    /// whatever the covariance says.
    [[nodiscard]] bool one_level() const noexcept;
};

/// Which coefficients the data determine. Filter order.
struct Observability {
    std::array<bool, kParameters> observable{};
    std::size_t undetermined = 0;  ///< dimension of the space of undetermined directions
    /// Its basis in units of the prior sigma, orthonormal: the first `undetermined` columns.
    Covariance directions = Covariance::Zero();
};

/// Compares the posterior covariance with the prior: a direction keeps more than half its prior
/// standard deviation when nothing worth having was learnt about it. Works on the covariance
/// normalised by the prior, whose large eigenvalues are the small ones of the information gained.
/// Neither allocates nor throws.
[[nodiscard]] Observability observability(const Covariance& posterior, const ParameterArray& prior,
                                          const KappaSpread& kappa) noexcept;

/// Combinations of the undetermined coefficients that the data do determine, by name.
[[nodiscard]] std::vector<Combination> determined_combinations(const Observability& found,
                                                               const Covariance& posterior,
                                                               const ParameterArray& value,
                                                               const ParameterArray& prior);

}  // namespace vibrig::estimator
