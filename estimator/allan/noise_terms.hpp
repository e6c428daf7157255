#pragma once

#include <array>
#include <cstddef>

namespace vibrig::estimator::allan {

inline constexpr std::size_t kTerms = 5;
/// Quantisation, angle random walk, bias instability, rate random walk, rate ramp.
enum class Term : unsigned char { Q, N, B, K, R };
inline constexpr std::array<const char*, kTerms> kTermNames{"Q", "N", "B", "K", "R"};
inline constexpr std::array<const char*, kTerms> kTermUnits{"arcsec", "deg/rt-h", "deg/h",
                                                            "deg/h^1.5", "deg/h^2"};
using Terms = std::array<double, kTerms>;  ///< by Term, in the units above

struct FittedTerm {
    bool detected = false;
    double value = 0;  ///< best estimate, detected or not; 0 where its square would be negative
    double sigma = 0;  ///< 1 sigma of the value, meaningful when detected; 0 if the value is
    double below = 0;  ///< the term is not larger, at two standard errors; infinite: no bound
};

/// Modified Allan deviation of the angle residuals, all kept dwells together.
struct DwellPoint {
    double tau_s = 0;
    double deviation = 0;  ///< deg/h
    double expected = 0;   ///< of the identified resolver noise and random walk, deg/h
    /// Classical: of rates averaged side by side about their own mean, deg/h. Of one dwell only.
    double classical = 0;
};

/// Allan variance, (deg/h)^2, that a unit coefficient gives at tau: 3/tau^2, 3600/tau, 2 ln2/pi,
/// tau/10800, tau^2/(2 3600^2) (IEEE Std 952; tau in s).
[[nodiscard]] double term_variance(Term term, double tau);
[[nodiscard]] double model_variance(const Terms& terms, double tau);

}  // namespace vibrig::estimator::allan
