#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "estimator/allan/curve_covariance.hpp"
#include "estimator/allan/noise_terms.hpp"

namespace vibrig::estimator::allan {

/// A term is detected above this many standard errors of its square (as in the dwell monitor),
inline constexpr double kDetected = 3;
/// and otherwise below this many above the estimate.
inline constexpr double kBound = 2;

struct Fit {
    std::array<FittedTerm, kTerms> terms;
    /// Not empty when the ramp cannot be told from the rate random walk in this record.
    std::string ramp_note;
    /// Best estimates, detected or not.
    [[nodiscard]] Terms values() const;
};

/// A variance (not deviation) of the curve with what the weights need.
struct VariancePoint {
    double tau = 0;  ///< s
    std::size_t m = 1;
    double variance = 0;  ///< (deg/h)^2
    double share = 1;     ///< terms present over terms of a record without gaps
};

inline constexpr std::array<bool, kTerms> kAllTerms{true, true, true, true, true};

/// Non-negative least squares on the overlapping Allan variance, weights W = sqrt(edf / 2) / model,
/// re-weighted 12 times. Needs two points.
///
/// Overlapping variances at near averaging times come from the same differences, so that the normal
/// matrix alone makes errors much too small. With the basis F (one column a term) the squared
/// coefficients are x = G v, G = (F' W^2 F)^-1 F' W^2 of the terms that are not zero; their
/// covariance is G C G' with C = cov(v) of the fitted model (CurveCovariance; a record with gaps:
/// entries over sqrt(share share)). A coefficient c = sqrt(x) has sigma(x) / (2 c). It is detected
/// when x > kDetected sigma(x), otherwise below sqrt(x + kBound sigma(x)). For a term whose square
/// would be negative x is 0 and sigma(x) that of a fit with it added.
[[nodiscard]] Fit fit_noise(std::span<const VariancePoint> curve, const CurveCovariance& covariance,
                            const std::array<bool, kTerms>& wanted = kAllTerms);
/// For one curve of `points` phase points at step tau0 (s).
[[nodiscard]] Fit fit_noise(std::span<const VariancePoint> curve, std::size_t points, double tau0,
                            const std::array<bool, kTerms>& wanted = kAllTerms);

}  // namespace vibrig::estimator::allan
