#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "estimator/allan/fit.hpp"

namespace vibrig::estimator::allan {

/// sigma_c^2 = a0 + a1 tau + a2 tau^2 + a3 / tau + a4 / tau^2: slow class a0 a1 a2, fast a3 a4.
using Polynomial = std::array<double, 5>;
inline constexpr std::array<int, 5> kPowers{0, 1, 2, -1, -2};
/// AVAR of a_k tau^n: 2 (1 - 2^n), that is 0, -2, -6, 1, 1.5.
[[nodiscard]] double allan_multiplier(int power);
/// The two parts of the classical variance at tau, (deg/h)^2.
struct ClassSums {
    double slow = 0;  ///< a0 + a1 tau + a2 tau^2
    double fast = 0;  ///< a3 / tau + a4 / tau^2
};
[[nodiscard]] ClassSums class_sums(const Polynomial& a, double tau);

/// What is known of the mean. With the mean of the window removed each tau^n becomes tau^n - T^n,
/// so a0 cancels and cannot be known.
enum class MeanMode : unsigned char {
    window_mean,  ///< the paper's way, for reproduction: fits a0 although it cancelled
    corrected,    ///< basis tau^n - T^n without a0 (see ClassicalPoint)
    known_mean    ///< deviations from a reference mean: the only way to an a0
};

/// Window-mean and known-mean: overlapping averages about that mean. Corrected: averages side by
/// side about the mean of just those, which cover `covered` seconds: only then is the expectation
/// exactly sigma_c^2(tau) - sigma_c^2(covered). Overlapping averages visit the window's middle more
/// often and leave tau and tau^2 almost indistinguishable.
struct ClassicalPoint {
    double tau = 0;       ///< s
    double variance = 0;  ///< (deg/h)^2
    double covered = 0;   ///< s
};

struct ClassicalFit {
    Polynomial a{};
    bool a0_known = false;
    /// Allan coefficients; NaN where the variance they would need is negative.
    Terms terms{};
    std::vector<std::string> notes;  ///< classes with negative sums, terms with negative squares
};

/// Weighted least squares, free of sign, relative to the variance itself.
[[nodiscard]] ClassicalFit fit_classical(std::span<const ClassicalPoint> curve, MeanMode mode);
/// Terms and notes of given coefficients, for instance of their mean over windows.
[[nodiscard]] ClassicalFit interpret(const Polynomial& a, bool a0_known, double shortest,
                                     double longest);

}  // namespace vibrig::estimator::allan
