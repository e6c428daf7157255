#pragma once

#include <array>
#include <random>
#include <string>
#include <vector>

#include "estimator/identification/identification.hpp"

namespace vibrig::estimator::testing {

struct PlannedRow {
    int position = 1;  ///< of Table 1
    int run = 1;
    double amplitude_g = 0;  ///< at the platform
};

/// The orders of dwells that leave no slow state confounded, and the plain ones.
[[nodiscard]] std::vector<PlannedRow> balanced(double first_g, double second_g);
[[nodiscard]] std::vector<PlannedRow> balanced_with_rest(double first_g);
[[nodiscard]] std::vector<PlannedRow> sequential(double first_g, double second_g);
[[nodiscard]] std::vector<PlannedRow> pairs(double first_g, double second_g);

/// Rows as the averaged model has them, without noise: dwells of 100 s, 60 s apart, coefficients of
/// Table 2, the platform half way through its turn; one variance for all rates.
[[nodiscard]] std::vector<DwellRow> theory_rows(const Settings& settings,
                                                const std::vector<PlannedRow>& plan);

constexpr double kRateVariance = 4.891201e-5;  ///< (deg/h)^2
constexpr double kRampVariance = 0.0322 * 0.0322;

/// White noise on rates and ramps.
void add_noise(std::vector<DwellRow>& rows, std::mt19937_64& random);

/// A result of these rows with which nothing else is wrong.
[[nodiscard]] Result result_of(std::vector<DwellRow> rows);

}  // namespace vibrig::estimator::testing
