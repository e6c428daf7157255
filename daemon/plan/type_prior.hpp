#pragma once

#include <string>
#include <vector>

#include "estimator/filter/settings.hpp"
#include "estimator/identification/result.hpp"
#include "estimator/uncertainty/population.hpp"

namespace vibrig::plan {

/// What an archive knows of a type of units; coefficients in the order of parameter_names().
struct TypePrior {
    std::string type;
    bool simulated = false;  ///< from campaigns on simulated rigs
    estimator::uncertainty::Population of;
    std::string vibration;               ///< of which the quadratic coefficients are, in words
    std::size_t of_other_vibration = 0;  ///< campaigns that were left out for that
};

/// As `vibrig archive type --json` prints it: one line.
[[nodiscard]] std::string to_json(const TypePrior& prior);
/// Throws std::runtime_error that says what is wrong with it.
[[nodiscard]] TypePrior type_prior_of(const std::string& json);

/// What an adaptive campaign may start its choice from.
struct Start {
    std::vector<double> covariance;  ///< 30 x 30, row-major
    std::string words;               ///< how the type came in
};
/// `measured` (30 x 30, row-major) joined with the type, where the unit passes for one of it by
/// Mahalanobis' distance; else `measured` alone.
[[nodiscard]] Start start_of(const TypePrior& prior, std::vector<double> measured,
                             const estimator::Settings& settings, const estimator::Result& result);

}  // namespace vibrig::plan
