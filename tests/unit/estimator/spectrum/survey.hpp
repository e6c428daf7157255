#pragma once

#include <array>
#include <random>
#include <vector>

#include "estimator/identification/identification.hpp"
#include "estimator/spectrum/prediction.hpp"
#include "estimator/spectrum/profile.hpp"
#include "estimator/spectrum/table.hpp"

namespace vibrig::estimator::spectrum::testing {

/// The resonance of the theory's numbers.
inline constexpr Resonance kSixty{60, 0.05};

/// An elastic part of a gyro: coefficients in the filter's order.
struct ElasticPart {
    Resonance resonance;
    std::array<double, 6> coefficients{};
};

/// Nothing declared that rows drawn here do not have.
[[nodiscard]] Settings undeclared();

/// The static coefficients of Table 2, filter order.
[[nodiscard]] ParameterArray table2();

/// Gyros with the static coefficients of Table 2.
struct Truth {
    std::array<std::vector<ElasticPart>, 3> elastic;
    /// All quadratic coefficients elastic by this share, one resonance for all.
    [[nodiscard]] static Truth common(double share, const Resonance& resonance);
};

struct PlannedDwell {
    int position = 1;  ///< of Table 1
    double hz = 0;     ///< 0: rest
    double gain = 1;   ///< of the accelerometers at this frequency
    double amplitude_g = 6;
};
/// 15 Hz at all positions, rest at seven, six frequencies more at seven: 63 dwells, as listed.
[[nodiscard]] std::vector<PlannedDwell> survey(double amplitude_g = 6);
/// 15 Hz and rest at all 14.
[[nodiscard]] std::vector<PlannedDwell> today();
void shuffle(std::vector<PlannedDwell>& plan, std::mt19937_64& random);

struct Dwells {
    std::vector<SpectralDwell> list;
    std::vector<Kind> kinds;
};
/// Dwells of 100 s, 160 s apart, without noise.
[[nodiscard]] Dwells dwells_of(const Settings& settings, const Truth& truth,
                               const std::vector<PlannedDwell>& plan);
void add_noise(Dwells& dwells, std::mt19937_64& random);

/// Drift that is true in a situation, deg/h.
[[nodiscard]] Eigen::Vector3d drift_of(const Settings& settings, const Truth& truth,
                                       const Situation& in);
[[nodiscard]] Situation situation_of(const Profile& profile, const std::array<double, 3>& deg);
/// The six profiles of the theory's first table, and its eight attitudes.
[[nodiscard]] std::vector<Profile> six_profiles();
[[nodiscard]] std::vector<std::array<double, 3>> eight_attitudes();

}  // namespace vibrig::estimator::spectrum::testing
