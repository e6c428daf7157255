#pragma once

#include <cstddef>

#include "estimator/allan/series.hpp"

namespace vibrig::estimator::allan {

enum class Statistic : unsigned char { adev, oadev, mdev, hdev, ohdev, tdev, totdev };

/// Exponent of the rate's power spectral density f^alpha: 2 white PM (Q), 1 flicker PM, 0 white FM
/// (N), -1 flicker FM (B), -2 random-walk FM (K).
using Alpha = int;

/// Equivalent degrees of freedom of one statistic for `points` phase points and averaging factor m.
/// OADEV: the closed forms of NIST SP 1065, section 5.4; TOTDEV: its table, white PM from the rows
/// of the reflected differences; the others: C. Greenhall, W. Riley, "Uncertainty of stability
/// variances based on finite differences", 2003.
[[nodiscard]] double edf(Statistic statistic, Alpha alpha, std::size_t points, std::size_t m);

/// Dominant noise at averaging factor m from the lag-1 autocorrelation of phase decimated by m
/// (SP 1065, section 5.5.3), over all segments of at least 20 such points together; with fewer than
/// 200, averaged with those of m / 2, m / 4 ... Returns `fallback` when none has 30 points.
[[nodiscard]] Alpha identify_noise(const Series& series, std::size_t m, Alpha fallback);

/// x with P(chi-square <= x) = probability for any real number of degrees of freedom > 0.
[[nodiscard]] double chi_square_quantile(double probability, double degrees);

/// x with P(F <= x) = probability, F of these degrees of freedom (both > 0).
[[nodiscard]] double f_quantile(double probability, double numerator, double denominator);

[[nodiscard]] double normal_quantile(double probability);

}  // namespace vibrig::estimator::allan
