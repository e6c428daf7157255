#pragma once

#include <array>
#include <span>
#include <string>

#include "estimator/spectrum/profile.hpp"

namespace vibrig::estimator::spectrum {

/// What a random dwell's PSD at the table has to agree with.
struct PsdExpected {
    Profile nominal;            ///< at the table, at the level that was asked for
    double measured_g_rms = 0;  ///< by the controller, over the dwell; 0: not reported
    double seconds = 0;         ///< of the dwell
    double gain_error = 0.01;   ///< of the mean square that is played, relative, 1 sigma
    /// As it came after the random dwell before; empty: there was none.
    std::span<const std::array<double, 2>> before{};
};

/// A controller's PSD as it can be used; `wrong` says why it cannot, with place, what was found and
/// what was expected.
struct PsdTaken {
    Profile psd{};
    std::string wrong{};
};

/// Takes the pairs (Hz, g^2/Hz) that a controller tells after a dwell, one-sided, at the table.
/// Refused are numbers that are none, densities below 0, frequencies that do not rise, fewer than
/// two lines, no power at all; the same to the last bit as after the dwell before, which a measured
/// spectrum never is; ends that leave out more of the profile's power than four gain errors; a mean
/// square that is further from the controller's own than four standard errors of both (each
/// 1/sqrt(B_e T) and the gain, docs/theory/spectrum.md); an rms 3 dB off the profile's; and a shape
/// of which less than half lies where the profile's does, which no spectrum within 3 dB of it
/// reaches. A density of 0 is taken as 1e-9 of the largest.
[[nodiscard]] PsdTaken take_controller_psd(std::span<const std::array<double, 2>> pairs,
                                           const PsdExpected& expected);

/// The lines of pairs that were taken once: as a profile, without what is not used at their end.
[[nodiscard]] Profile lines_of(std::span<const std::array<double, 2>> pairs,
                               const std::string& name);

}  // namespace vibrig::estimator::spectrum
