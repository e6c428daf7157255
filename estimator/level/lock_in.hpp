#pragma once

#include <cstddef>

namespace vibrig::estimator {

/// m + a sin(w t + phase) with its second harmonic, t = 0 at the first sample of the window it was
/// fitted to.
struct Vibration {
    double mean = 0;       ///< g
    double amplitude = 0;  ///< g, peak, fundamental, not yet divided by the mean
    double phase = 0;      ///< rad, at the first sample
    double frequency_hz = 0;
    double cosine = 0, sine = 0, cosine2 = 0, sine2 = 0;  ///< g
    /// Of the fundamental over the samples fitted, g^2: half of amplitude^2, but next to a multiple
    /// of half the sample rate, where a column vanishes and a large amplitude says nothing.
    double variance = 0;
    [[nodiscard]] double at(double time_s) const noexcept;
};

/// A stretch of a ring buffer at constant sample period. Samples whose `valid` is false are left
/// out.
struct Window {
    const double* value = nullptr;
    const bool* valid = nullptr;
    std::size_t capacity = 0, begin = 0, count = 0;
    double period_s = 0;
};

/// Block length, samples, over which `frequency_hz` is closest to whole periods.
[[nodiscard]] std::size_t lock_in_block(double frequency_hz, double period_s,
                                        std::size_t longest) noexcept;

/// Lock-in near `nominal_hz`: phase slope of block phasors, then least squares with the frequency
/// refined. Never allocates.
[[nodiscard]] Vibration lock_in(const Window& window, double nominal_hz) noexcept;

}  // namespace vibrig::estimator
