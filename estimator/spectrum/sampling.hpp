#pragma once

namespace vibrig::estimator::spectrum {

/// Harmonics of a line that must not fall on a multiple of the sample rate.
inline constexpr int kHarmonics = 5;
/// The planner keeps so many free: a third and a fifth harmonic do not fall on one another either.
inline constexpr int kHarmonicsPlanned = 8;

/// True where a harmonic of `hz` lies so near a multiple of the sample rate that the level over
/// `window_s` is wrong.
[[nodiscard]] bool forbidden(double hz, double sample_hz, double window_s,
                             int harmonics = kHarmonics) noexcept;
/// The nearest frequency, in steps of `step_hz`, that is not; of two as near the higher one.
[[nodiscard]] double nearest_free(double hz, double sample_hz, double window_s,
                                  int harmonics = kHarmonics, double step_hz = 0.1) noexcept;

}  // namespace vibrig::estimator::spectrum
