#pragma once

#include <array>
#include <cstdint>
#include <functional>

#include "estimator/uncertainty/assessment.hpp"

namespace vibrig::estimator::uncertainty {

struct MonteCarloSettings {
    std::uint64_t seed = 1;
    int digits = 1;  ///< of u that the result is to hold for
    int most_blocks = 400;
    int block = 10'000;
};

/// Propagation of distributions, JCGM 101: 7.9 (adaptive) and 8 (check of the budget).
struct MonteCarlo {
    int blocks = 0, digits = 1;
    bool stable = false;            ///< before the most blocks were drawn
    bool gum_confirmed = false;     ///< for every coefficient
    double largest_difference = 0;  ///< of an end of the interval, in the tolerance delta
    /// What all inputs at once do, less the sum of what each does: rms over the coefficients and
    /// draws, relative to u_B.
    double nonlinearity = 0;
    struct Coefficient {
        double u = kNone, low = kNone,
               high = kNone;  ///< of the probabilistically symmetric interval
        bool confirmed = false;
    };
    std::array<Coefficient, kParameters> coefficients;  ///< order of parameter_names()
};

/// `assessed` must be of `result`; inputs that are correlated are drawn as normal. `progress` hears
/// of the blocks done. Throws SettingsError when there is nothing assessed.
[[nodiscard]] MonteCarlo propagate_distributions(const Settings& settings, const Result& result,
                                                 const Assessment& assessed,
                                                 const MonteCarloSettings& how = {},
                                                 const std::function<void(int)>& progress = {});

/// One block of draws by itself, for those who share the blocks out; the coefficients less their
/// estimates, in the order of parameter_names().
struct DrawnBlock {
    struct Coefficient {
        double mean = kNone, u = kNone;
        double low = kNone, high = kNone;                    ///< symmetric interval
        double shortest_low = kNone, shortest_high = kNone;  ///< JCGM 101, 7.7
    };
    std::array<Coefficient, kParameters> coefficients;
};

/// Draws `count` of a seed, as propagate_distributions() does. One thread at a time.
using BlockDrawing = std::function<DrawnBlock(std::uint64_t seed, int count)>;
/// Throws SettingsError when there is nothing assessed.
[[nodiscard]] BlockDrawing block_drawing(const Settings& settings, const Assessment& assessed);

/// Half a unit of the last of so many digits of u: what a result is to hold to, JCGM 101, 7.9.2.
[[nodiscard]] double numerical_tolerance(double u, int digits);

}  // namespace vibrig::estimator::uncertainty
