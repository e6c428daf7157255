#pragma once

#include <array>

namespace vibrig::estimator {

/// Shape of a vibration's second moment about the mean, level axes (north, up, east), over its
/// vertical part: NN, UU (1), EE, NU, NE, UE.
using LevelTensor = std::array<double, 6>;
inline constexpr LevelTensor kVertical{0, 1, 0, 0, 0, 0};

/// What of the vibration enters the drift: its level and its shape.
struct VibrationMoment {
    double kappa = 1;  ///< mean square of the vertical specific force, g^2
    LevelTensor gamma = kVertical;
};

}  // namespace vibrig::estimator
