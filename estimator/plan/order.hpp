#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "estimator/plan/model.hpp"

namespace vibrig::estimator::plan {

/// What a campaign spends besides measuring.
struct Timing {
    double dwell_s = 100;
    double settle_s = 3;
    double ramp_s = 2;          ///< up, and down again; none at rest
    double slew_deg_per_s = 5;  ///< each gimbal, all at once
    double look_s = 1.5;        ///< gravity against the encoders, before the ramp: 1 to 2 s
};

struct Visit {
    Vec3 position_deg{};
    double level_g = 0;
};

using Order = std::vector<std::size_t>;  ///< of the visits

/// From one position to another: the gimbal that has furthest to go decides, the short way round.
[[nodiscard]] double slew_s(const Vec3& from, const Vec3& to, const Timing& timing) noexcept;

/// Dwells, settling, ramps and slews, from zero gimbal angles on.
struct Duration {
    double total_s = 0, slewing_s = 0, vibrating_s = 0;
};
[[nodiscard]] Duration duration(const std::vector<Visit>& visits, const Order& order,
                                const Timing& timing);

/// Strongest correlation of the place in the order with a term of the model: what a slow drift
/// would be taken for. 0: balanced.
[[nodiscard]] double drift_imbalance(const std::vector<Row>& regressors, const Order& order);

/// Nearest neighbour, then 2-opt: little gimbal travel.
[[nodiscard]] Order shortest_travel(const std::vector<Visit>& visits, const Timing& timing);
/// Shuffled within blocks of at most `block` runs, each with its share of what stands together in
/// the list; the best balanced of some draws.
[[nodiscard]] Order randomised(const std::vector<Row>& regressors, std::size_t block,
                               std::uint64_t seed);

}  // namespace vibrig::estimator::plan
