#pragma once

#include <array>
#include <span>

namespace vibrig::estimator {

/// One instant of the loop check.
struct LoopReading {
    double time_s = 0;
    std::array<double, 3> force_g{};  ///< specific force, platform axes
    double table_g = 0;               ///< along the table accelerometer's axis
    bool table_good = false;
    std::array<double, 3> angle_rad{};  ///< encoders as they count: outer, inner, azimuth
};

/// How the platform answers the table at one steady frequency.
struct LoopResponse {
    double frequency_hz = 0;
    double platform_g = 0;     ///< peak, along the vertical
    double mean_force_g = 0;   ///< 1 where the vertical is gravity's
    double distortion = 0;     ///< rms of all but the fundamental over that of the fundamental
    double cross_share = 0;    ///< peak across the vertical over peak along it
    double cross_sigma = 0;    ///< of its in-phase and quadrature part on each of two axes
    bool table_known = false;  ///< every reading of the table accelerometer was good
    double table_g = 0;        ///< peak
    double phase_deg = 0;      ///< platform after table; negative: it lags; [-180, 180]
};

/// Least squares of a constant and a sine on each axis, the frequency that which leaves the least,
/// within half a hertz of `nominal_hz`; the vertical is the mean force. Ten readings and one period
/// at least, else zeros. Frequencies above half the rate are met by their alias.
[[nodiscard]] LoopResponse loop_response(std::span<const LoopReading> readings, double nominal_hz);
/// The same at a frequency that is known.
[[nodiscard]] LoopResponse loop_response_at(std::span<const LoopReading> readings, double hz);

}  // namespace vibrig::estimator
