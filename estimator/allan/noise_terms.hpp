#pragma once

#include <array>
#include <cstddef>

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

}  // namespace vibrig::estimator::allan
