#pragma once

#include <span>

#include "estimator/level/loop_response.hpp"

namespace vibrig::estimator {

/// How a body swings on its pads when what drove it has stopped.
struct RingDown {
    double rate_per_s = 0;    ///< of the decay of the amplitude, 1/s; 0: it could not be determined
    double damping = 0;       ///< relative, 1
    double frequency_hz = 0;  ///< of the undamped swing; beyond 1 / 2 T its alias
};

/// The swing in evenly sampled readings that begin after the drive has ended: the deviation of the
/// norm of the specific force from its mean over the last quarter follows
/// x(t) = a x(t - T) - b x(t - 2 T), T = 20 ms or a sample, with b = exp(-2 rate T),
/// a = 2 exp(-rate T) cos(w T); a and b by least squares over what is above `floor_g`. No result
/// from fewer than eight such readings, or where the fit does not decay.
[[nodiscard]] RingDown ring_down(std::span<const LoopReading> readings, double floor_g);

}  // namespace vibrig::estimator
