#pragma once

#include <Eigen/Core>
#include <array>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "daemon/configuration/configuration.hpp"
#include "daemon/plan/profile_file.hpp"
#include "estimator/spectrum/elastic.hpp"

namespace vibrig::tool {

/// By its name: of the configuration's [[profile]] tables, built in, or a file. Throws
/// std::runtime_error.
[[nodiscard]] plan::StatedProfile find_profile(const std::string& name,
                                               const configuration::Configuration& rig);

/// A profile as the platform has it.
struct AtPlatform {
    std::vector<estimator::spectrum::Band> bands;
    Eigen::Matrix3d moment;                     ///< level frame, g^2
    std::vector<Eigen::Matrix3d> moments = {};  ///< of each band, where they are not along one line
    bool behind_pads = false;
};
/// `at`: "platform" or "table". Throws std::runtime_error where nothing is known between them.
[[nodiscard]] AtPlatform at_platform(const estimator::spectrum::Profile& profile,
                                     const std::string& at,
                                     const configuration::Configuration& rig);

/// "platform" or "table": what the profile says itself, as a [[profile]] of the configuration
/// always does; else what is asked for, else "platform". Throws std::runtime_error where the two
/// differ.
[[nodiscard]] std::string where_it_holds(const plan::StatedProfile& stated,
                                         const std::optional<std::string>& asked);

/// Of the strongest dwell of a result (vibrig identify --json) at the platform, g rms; 0: it does
/// not say.
[[nodiscard]] double strongest_g_rms(const nlohmann::json& result);

/// The built-in ones.
[[nodiscard]] std::string profiles_text();
[[nodiscard]] nlohmann::ordered_json profiles_json();

/// "ALPHA,BETA,GAMMA" of the gimbals, deg. Throws std::runtime_error.
[[nodiscard]] std::array<double, 3> read_attitude(const std::string& text);

}  // namespace vibrig::tool
