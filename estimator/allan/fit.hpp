#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "estimator/allan/edf.hpp"

namespace vibrig::estimator::allan {

inline constexpr std::size_t kTerms = 5;
/// Quantisation, angle random walk, bias instability, rate random walk, rate ramp.
enum class Term : unsigned char { Q, N, B, K, R };
inline constexpr std::array<const char*, kTerms> kTermNames{"Q", "N", "B", "K", "R"};
inline constexpr std::array<const char*, kTerms> kTermUnits{"arcsec", "deg/rt-h", "deg/h",
                                                            "deg/h^1.5", "deg/h^2"};
using Terms = std::array<double, kTerms>;  ///< by Term, in the units above

/// Allan variance, (deg/h)^2, that a unit coefficient gives at tau: 3/tau^2, 3600/tau, 2 ln2/pi,
/// tau/10800, tau^2/(2 3600^2) (IEEE Std 952; tau in s).
[[nodiscard]] double term_variance(Term term, double tau);
[[nodiscard]] double model_variance(const Terms& terms, double tau);
/// The noise that contributes most at tau, as an exponent of the rate spectrum.
[[nodiscard]] Alpha dominant_noise(const Terms& terms, double tau);

struct FittedTerm {
    bool detected = false;
    double value = 0;
    double sigma = 0;  ///< 1 sigma, of the detected value
    double below = 0;  ///< not detected: adds one standard error to the curve at its best tau
};

struct Fit {
    std::array<FittedTerm, kTerms> terms;
    /// Not empty when the ramp cannot be told from the rate random walk in this record.
    std::string ramp_note;
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

/// Non-negative least squares on the overlapping Allan variance, weights sqrt(edf / 2) / model,
/// re-weighted 12 times. `points` phase points at step tau0 (s) made the curve. Needs two points.
[[nodiscard]] Fit fit_noise(std::span<const VariancePoint> curve, std::size_t points, double tau0,
                            const std::array<bool, kTerms>& wanted = kAllTerms);

}  // namespace vibrig::estimator::allan
