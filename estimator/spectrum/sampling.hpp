#pragma once

#include <optional>
#include <string>

namespace vibrig::estimator::spectrum {

/// Harmonics of a line that must not fall on a multiple of the sample rate.
inline constexpr int kHarmonics = 5;
/// The planner keeps so many free: a third and a fifth harmonic do not fall on one another either.
inline constexpr int kHarmonicsPlanned = 8;

/// True where a harmonic of `hz` lies so near a multiple of the sample rate that the level over
/// `window_s` is wrong.
[[nodiscard]] bool forbidden(double hz, double sample_hz, double window_s,
                             int harmonics = kHarmonics) noexcept;
/// The nearest frequency, in steps of 0.1 Hz, that is not: as the planner has them, else as the
/// level has them. Of two as near the higher one; none where the window is too short for any.
[[nodiscard]] std::optional<double> nearest_free(double hz, double sample_hz,
                                                 double window_s) noexcept;
/// In words, which a frequency that is forbidden is answered with.
[[nodiscard]] std::string nearest_free_words(double hz, double sample_hz, double window_s);

}  // namespace vibrig::estimator::spectrum
