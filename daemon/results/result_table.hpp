#pragma once

#include <string>

#include "estimator/identification/result.hpp"
#include "estimator/uncertainty/monte_carlo.hpp"

namespace vibrig::tool {

/// Exit status of a command that gives a result of which so much can be believed; `strict`: doubts
/// count too.
[[nodiscard]] int exit_status(estimator::uncertainty::Level level, bool strict);

/// A result for people: the 30 coefficients, the amplitudes, what could not be separated, the
/// verdict, warnings.
[[nodiscard]] std::string result_table(const estimator::Result& result,
                                       const estimator::uncertainty::Assessment& assessed);

/// What the Monte Carlo says of the budget, in one line; with coefficients whose interval is
/// another one.
[[nodiscard]] std::string monte_carlo_text(const estimator::uncertainty::MonteCarlo& drawn);

}  // namespace vibrig::tool
