#pragma once

#include <span>
#include <string>
#include <vector>

#include "estimator/allan/edf.hpp"
#include "estimator/allan/series.hpp"

namespace vibrig::estimator::allan {

/// One point of a curve. `dev` has the rate's unit (TDEV: the phase's).
struct Point {
    std::size_t m = 1;
    double tau = 0;  ///< s
    double dev = 0;
    double lo = 0;  ///< interval at the confidence asked for
    double hi = 0;
    double edf = 1;
    std::size_t n = 0;  ///< terms in the sum
    Alpha alpha = 0;    ///< noise identified at this tau
};

inline constexpr double kOneSigma = 0.6826894921370859;

[[nodiscard]] const char* name_of(Statistic statistic);
/// Throws DataError naming the statistics that exist.
[[nodiscard]] Statistic statistic_named(const std::string& name);

/// Largest averaging factor that a record of n rates allows.
[[nodiscard]] std::size_t largest_factor(Statistic statistic, std::size_t rates);

[[nodiscard]] std::vector<std::size_t> octave_factors(std::size_t largest);
[[nodiscard]] std::vector<std::size_t> decade_factors(
    std::size_t largest);  ///< 1, 2, 4, 10, 20, ...
[[nodiscard]] std::vector<std::size_t> all_factors(std::size_t largest);
/// About `count` factors, evenly spaced in log tau, without repetition.
[[nodiscard]] std::vector<std::size_t> log_factors(std::size_t largest, std::size_t count);
/// From seconds; each must be a multiple of tau0 that the record allows. Throws DataError.
[[nodiscard]] std::vector<std::size_t> factors_of(std::span<const double> taus, double tau0,
                                                  std::size_t largest);

/// Factors for which no term exists are left out.
[[nodiscard]] std::vector<Point> deviations(const Series& series, Statistic statistic,
                                            std::span<const std::size_t> factors,
                                            double confidence = kOneSigma);

}  // namespace vibrig::estimator::allan
