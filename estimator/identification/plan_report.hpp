#pragma once

#include <array>
#include <string>
#include <vector>

#include "estimator/identification/crlb.hpp"
#include "estimator/identification/result.hpp"

namespace vibrig::estimator {

/// What a plan would determine, before it is run. Order of parameter_names().
struct PlanReport {
    std::array<bool, kParameters> observable{};
    std::array<double, kParameters> sigma{};  ///< expected, prior included; NaN: not determined
    std::vector<Combination> combinations;    ///< determined in place of what is not; value 0
    std::string obstacle;  ///< why the two-step route cannot work: then nothing is determined
};

/// `period_s`: between samples. Throws SettingsError. Two vibration levels are told apart as in the
/// result of a run.
[[nodiscard]] PlanReport report_plan(const Settings& settings,
                                     const std::vector<PlannedDwell>& plan, double period_s);

/// The plan of a campaign: every position, encoder angles in deg, at every level at the table.
[[nodiscard]] std::vector<PlannedDwell> campaign_plan(
    const Settings& settings, const std::vector<std::array<double, 3>>& positions_deg,
    const std::vector<double>& table_g, double dwell_s);

/// For people: one line with the coefficients that are not determined, one for each combination
/// that is; nothing if all 30 are.
[[nodiscard]] std::vector<std::string> plan_warnings(const PlanReport& report);

}  // namespace vibrig::estimator
