#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "estimator/allan/curve_covariance.hpp"
#include "estimator/allan/likelihood.hpp"
#include "estimator/allan/noise_terms.hpp"

namespace vibrig::estimator::allan {

/// A set of terms is excluded when -2 ln(likelihood) lies above that of another by the square of so
/// many standard errors. A term is detected when every set without it is excluded.
inline constexpr double kDetected = 3;
/// For B, K and R, which show at averaging times of one to three degrees of freedom: there records
/// of another slow noise go beyond 3 in 1 to 2 % and beyond 4 in less than 0.3 % (simulated).
inline constexpr double kDetectedSlow = 4;
/// A term that is not detected is smaller than what lies so many standard errors away.
inline constexpr double kBound = 2;
inline constexpr double kBoundSlow = kBound * kDetectedSlow / kDetected;
/// Noise beside Q and N is there when they alone cost this much: exceeded by white noise with
/// probability 1.35e-3 (half chi-square(1), half chi-square(2): two slow terms, not negative).
inline constexpr double kLongTerm = 12.2;

/// A set of terms and how much speaks for it.
struct NoiseModel {
    TermSet terms{};
    double weight = 0;  ///< Akaike's, of all sets together 1
};

/// Noise beside the best fit of Q and N, of whatever kind.
struct SlowNoise {
    bool found = false;
    double tau = 0;           ///< s, where it stands out most
    double ratio = 1;         ///< deviation there over that of Q and N
    double deviance = 0;      ///< what Q and N alone cost, see kLongTerm
    bool determined = false;  ///< B, K or R is detected
};

struct Fit {
    std::array<FittedTerm, kTerms> terms;
    SlowNoise slow;
    std::vector<NoiseModel> models;  ///< by weight, those of at least 1 %
    /// Not empty when the ramp cannot be distinguished from the rate random walk in this record.
    std::string ramp_note;
    /// Best estimates, detected or not.
    [[nodiscard]] Terms values() const;
    /// The verdict on the slow noise, for people; empty when its kinds are detected.
    [[nodiscard]] std::string verdict() const;
};

inline constexpr TermSet kAllTerms{true, true, true, true, true};

/// Noise of a curve of overlapping Allan variances, at least two points. All sets of the wanted
/// terms are fitted by maximum likelihood with the full covariance of the curve (CurveLikelihood):
/// overlapping variances come from the same differences, and terms compete for the same few points.
///
/// Values are means over the sets with Akaike's weights w ~ exp(-(-2 ln L + 2 parameters) / 2),
/// sigma^2 = sum w (sigma_set^2 + (value_set - value)^2) (Burnham, Anderson, Model Selection and
/// Multimodel Inference, 2002, section 4.3). Detection asks whether any set without the term does
/// as well; a bound is the largest value that any set with the term allows which is not excluded.
[[nodiscard]] Fit fit_noise(std::span<const VariancePoint> curve, const CurveCovariance& covariance,
                            const TermSet& wanted = kAllTerms);
/// For one curve of `points` phase points at step tau0 (s).
[[nodiscard]] Fit fit_noise(std::span<const VariancePoint> curve, std::size_t points, double tau0,
                            const TermSet& wanted = kAllTerms);

}  // namespace vibrig::estimator::allan
