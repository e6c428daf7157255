#pragma once

#include <Eigen/Core>
#include <array>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "daemon/tool/analysis/profile_options.hpp"
#include "estimator/spectrum/prediction.hpp"

namespace vibrig::tool {

/// Dwells under the profile: what they showed, and where.
struct Held {
    std::vector<estimator::spectrum::Situation> situations;
    Eigen::MatrixXd rates;
    std::vector<Eigen::Matrix3d> variances;
    std::vector<double> relative_errors;
    std::vector<std::array<double, 3>> deg;
    bool simulated = false;  ///< the rig was a program
    std::string doubt;  ///< how the recording contradicts its configuration; empty: it does not
};

/// Of a recording, to prove a result: of vibrig identify --json, and not fitted with them. Throws
/// std::runtime_error where there is none.
[[nodiscard]] Held held_out(const std::string& recording, const std::string& config,
                            const estimator::spectrum::Profile& profile,
                            const AtPlatform& vibration, const nlohmann::json& result);

}  // namespace vibrig::tool
