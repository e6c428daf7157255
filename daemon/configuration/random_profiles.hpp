#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "daemon/configuration/configuration.hpp"
#include "daemon/plan/plan_file.hpp"
#include "estimator/filter/measurement.hpp"
#include "estimator/spectrum/kind.hpp"

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

/// What a controller's PSD at the table, of its dwell, is at the platform.
struct PsdAtPlatform {
    estimator::RandomVibration random;  ///< profile and level are left to the dwell
    estimator::Seen seen;
    std::vector<estimator::spectrum::Band> bands;
};
/// None where the transmission is not known, or the accelerometers see less than half of it.
[[nodiscard]] std::optional<PsdAtPlatform> at_platform(
    const Configuration& rig, const estimator::spectrum::Profile& at_table);
/// The same of pairs as a recording has them, which were taken: their bands alone, or none.
[[nodiscard]] std::vector<estimator::spectrum::Band> reported_bands(
    const Configuration& rig, int number, double level_db,
    std::span<const std::array<double, 2>> pairs);
/// The profile with this number in the controller, at this level; none: there is no such.
[[nodiscard]] std::optional<estimator::spectrum::Profile> stated_at(const Configuration& rig,
                                                                    int number, double level_db);

/// The dwell of a plan's run under a profile, and its abort bands with the configuration's. Throws
/// plan::PlanFileError with its place, what was found and what was expected.
[[nodiscard]] campaign::Stop random_stop(Configuration& rig, const plan::PlannedRun& run);

/// What the accelerometers see of the profiles that have a number, where they do not see all.
void take_seen(Configuration& rig);

/// Kinds of the profiles that have a number, by it.
[[nodiscard]] std::vector<std::pair<std::uint16_t, estimator::spectrum::Kind>> numbered_kinds(
    const Configuration& rig);

}  // namespace vibrig::configuration
