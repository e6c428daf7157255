#pragma once

#include <string>
#include <vector>

#include "estimator/spectrum/profile.hpp"

namespace vibrig::plan {

/// A profile with where it holds.
struct StatedProfile {
    estimator::spectrum::Profile profile;
    std::string at;  ///< "platform" or "table"; empty: not stated
};

/// JSON: psd [[hz, g2_hz], ..] or {north, up, east} of such lists with the real cross-spectra cross
/// {north_up, north_east, up_east}, sines [[hz, g_peak], ..], and optionally name, direction,
/// g_rms, at. Throws std::runtime_error with file, key, value and what was expected.
[[nodiscard]] StatedProfile read_profile(const std::string& path);

/// What a controller played under profiles: JSON [{"profile": NAME, "psd": [[hz, g2_hz], ..]}, ..],
/// each name once. Throws as read_profile().
[[nodiscard]] std::vector<estimator::spectrum::Profile> read_controller_psd(
    const std::string& path);

}  // namespace vibrig::plan
