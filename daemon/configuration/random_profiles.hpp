#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "daemon/configuration/configuration.hpp"
#include "daemon/plan/plan_file.hpp"
#include "estimator/spectrum/table.hpp"

namespace vibrig::configuration {

/// A profile as a controller plays it at 0 dB, along the vertical.
struct PlayedProfile {
    double table_g = 0, platform_g = 0;  ///< rms
    double table_bandwidth_hz = 0, platform_bandwidth_hz = 0;
    double highest_hz = 0;
    std::vector<estimator::spectrum::Band> at_platform;  ///< shares of its mean square
    std::uint32_t checksum = 0;  ///< of the breakpoints, as the register map has it
};
/// None where the transmission is not known, or where there is no psd.
[[nodiscard]] std::optional<PlayedProfile> played(const Configuration& rig,
                                                  const Configuration::NamedProfile& profile);

/// The dwell of a plan's run under a profile, and its abort bands with the configuration's. Throws
/// plan::PlanFileError with its place, what was found and what was expected.
[[nodiscard]] campaign::Stop random_stop(Configuration& rig, const plan::PlannedRun& run);

/// What the accelerometers see of the profiles that have a number, where they do not see all.
void take_seen(Configuration& rig);

/// Kinds of the profiles that have a number, by it.
[[nodiscard]] std::vector<std::pair<std::uint16_t, estimator::spectrum::Kind>> numbered_kinds(
    const Configuration& rig);

}  // namespace vibrig::configuration
