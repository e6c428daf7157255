#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "estimator/spectrum/elastic.hpp"

namespace vibrig::estimator::spectrum {

/// Hz and g^2/Hz, one-sided, straight between the points on logarithmic scales, 0 outside.
using Breakpoints = std::vector<std::pair<double, double>>;

/// A random vibration along more than one line: PSDs along north, up and east, and the real
/// cross-spectra north-up, north-east and up-east. A cross-spectrum has either sign, and goes
/// straight in Hz where it changes it or is 0.
inline constexpr std::array<const char*, 3> kAxes{"north", "up", "east"},
    kAxisPairs{"north_up", "north_east", "up_east"};
struct AxesPsd {
    std::array<Breakpoints, 3> psd, cross;
    [[nodiscard]] bool stated() const noexcept;
};

/// A vibration as a user states it: stationary, along one line unless `axes` are stated.
struct Profile {
    std::string name;
    Breakpoints psd;
    std::vector<std::pair<double, double>> sines;  ///< Hz and g peak
    /// Direction of psd and sines; level frame: north, up, east; of length 1.
    std::array<double, 3> direction{0, 1, 0};
    double g_rms = 0;   ///< as stated; 0: not
    AxesPsd axes = {};  ///< in place of psd
};

/// Along these axes, of length 1; none: they have no length.
[[nodiscard]] std::optional<std::array<double, 3>> direction_along(
    const std::array<double, 3>& axes) noexcept;

/// Throws SettingsError naming the element, what was found and what was expected. `path` stands
/// before it, such as "profile.json: ".
void check(const Profile& profile, const std::string& path = {});

/// Powers are added, which of two sines (Hz, g peak) of one frequency holds in no phase but one.
/// Throws SettingsError with `place` before their number.
void refuse_one_frequency_twice(const Breakpoints& sines, const std::string& place);

/// Mean square of the whole profile, all axes together, g^2.
[[nodiscard]] double mean_square(const Profile& profile);

/// The bands of a profile, with their shares of its mean square: so many for each decade, each with
/// its exact power, and the sines.
[[nodiscard]] std::vector<Band> bands_of(const Profile& profile, int per_decade = 800);

/// B_e: the power of a time T strays by 1 / sqrt(B_e T) of it. Of sines alone 0: it does not.
[[nodiscard]] double bandwidth_hz(std::span<const Band> bands) noexcept;

/// The isolators' |platform over table|^2 at a frequency.
[[nodiscard]] double pads_power(double hz, const Resonance& pads) noexcept;
/// Natural frequency of pads with this damping whose transmission at `hz` is `ratio` (below 1).
[[nodiscard]] Resonance pads_with(double hz, double ratio, double damping) noexcept;
/// Bands of mean square `mean_square` behind the pads: theirs there, with what the mean square
/// becomes.
[[nodiscard]] std::pair<std::vector<Band>, double> behind(std::span<const Band> bands,
                                                          double mean_square,
                                                          const Resonance& pads);

/// Examples of the types, not a standard's text.
[[nodiscard]] std::span<const Profile> built_in_profiles();

}  // namespace vibrig::estimator::spectrum
