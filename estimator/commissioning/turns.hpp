#pragma once

#include <array>
#include <string>
#include <vector>

#include "estimator/commissioning/earth.hpp"

namespace vibrig::estimator::commissioning {

/// One gimbal was slewed and nothing else: readings before and after, in the channels' units, and
/// what the three gyros counted meanwhile, deg.
struct CountedTurn {
    Vec3 before{}, after{};
    Vec3 counted_deg{};
};

/// What the gyros' increments X, Y, Z count, platform axes of `description`.
struct TurnFinding {
    Verdict verdict = Verdict::undecided;
    std::string why;                                     ///< refused
    Eigen::Matrix3d response = Eigen::Matrix3d::Zero();  ///< counted over turned, a row each
    std::array<int, 3> axis{-1, -1, -1};                 ///< that a gyro counts turns about
    std::array<int, 3> sign{1, 1, 1};
    Vec3 scale{};
    /// Each gyro counts about the axis of its own name.
    [[nodiscard]] bool named() const { return axis == std::array<int, 3>{0, 1, 2}; }
};

/// While one gimbal turns and the others stand the platform turns about an axis fixed in it, so
/// that the counts of three such slews, one of each gimbal, are R times three known turns: R has
/// axis, sign and scale of each gyro (docs/commissioning.md, "Increments"). Scale to 5 %, axes to 3
/// deg. Throws std::invalid_argument where the turns do not span three axes, or something is not
/// finite.
[[nodiscard]] TurnFinding find_by_turns(const Description& description,
                                        const std::vector<CountedTurn>& turns);

}  // namespace vibrig::estimator::commissioning
