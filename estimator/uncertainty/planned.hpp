#pragma once

#include <array>
#include <vector>

#include "estimator/identification/result.hpp"

namespace vibrig::estimator::uncertainty {

/// One dwell that is to come.
struct PlannedStop {
    int run = 1, position = 1;
    std::array<double, 3> angles_deg{};  ///< gimbal angles: outer, inner, azimuth
    double amplitude_g = 0;              ///< at the platform
    double begin_s = 0, duration_s = 100;
};

/// What a campaign would give without any noise and with nothing wrong: its rows by the averaged
/// model, for assess(). `nominal`: coefficients in the order of parameter_names(); `period_s`
/// between samples. Throws SettingsError.
[[nodiscard]] Result planned_result(const Settings& settings, const std::vector<PlannedStop>& stops,
                                    const std::array<double, kParameters>& nominal,
                                    double period_s);

}  // namespace vibrig::estimator::uncertainty
