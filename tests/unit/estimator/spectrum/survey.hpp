#pragma once

#include <array>
#include <random>
#include <vector>

#include "estimator/identification/identification.hpp"
#include "estimator/spectrum/analysis.hpp"
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

/// The gain from one frequency to another declared to 0.5 %, nothing else.
[[nodiscard]] Settings gain_declared();

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
/// What the pads leave of 12 g at the table, and at 15 Hz of `at_15_g` there.
[[nodiscard]] std::vector<PlannedDwell> isolated_survey(const Resonance& pads, double at_15_g = 9);
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

/// The analysis of a campaign with noise, its order by chance where `mixed`.
[[nodiscard]] Analysis campaign(const Settings& settings, const Truth& truth,
                                std::vector<PlannedDwell> plan, unsigned seed, bool mixed = true,
                                Form form = Form::automatic);
/// Each gyro its own resonance, or none (three in ten): 25 to 300 Hz, damping 0.015 to 0.15,
/// elastic coefficients of 30 % rms.
[[nodiscard]] Truth random_rig(unsigned seed);
/// Both with damping 0.05, in all gyros, by these shares of all quadratic coefficients.
[[nodiscard]] Truth two_resonances_of(double first_hz, double first_share, double second_hz,
                                      double second_share);

/// Campaigns of a rate in every run: instrumented code takes its time.
[[nodiscard]] constexpr unsigned in_every_run([[maybe_unused]] unsigned campaigns,
                                              [[maybe_unused]] unsigned few) {
#ifdef VIBRIG_SANITIZED
    return few;
#else
    return campaigns;
#endif
}

/// Of so many campaigns the fewest, and the most, in which something of this rate may happen: less
/// or more has a chance of 1e-3.
[[nodiscard]] unsigned at_least(unsigned of, double rate);
[[nodiscard]] unsigned at_most(unsigned of, double rate);

/// Drift that is true in a situation, deg/h.
[[nodiscard]] Eigen::Vector3d drift_of(const Settings& settings, const Truth& truth,
                                       const Situation& in);
[[nodiscard]] Situation situation_of(const Profile& profile, const std::array<double, 3>& deg);
/// The six profiles of the theory's first table, and its eight attitudes.
[[nodiscard]] std::vector<Profile> six_profiles();
[[nodiscard]] std::vector<std::array<double, 3>> eight_attitudes();

}  // namespace vibrig::estimator::spectrum::testing
