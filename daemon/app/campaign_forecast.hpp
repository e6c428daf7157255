#pragma once

#include <optional>
#include <string>

#include "daemon/configuration/configuration.hpp"
#include "daemon/plan/adaptive.hpp"
#include "daemon/status/source.hpp"

namespace vibrig {

/// The planner of an adaptive campaign; nothing for any other. Throws std::runtime_error if its
/// levels cannot determine all coefficients.
[[nodiscard]] std::optional<plan::AdaptivePlan> adaptive_plan(
    const configuration::Configuration& configuration);

/// What the configured campaign will know at its end.
struct CampaignForecast {
    std::string words;
    std::string refusal;  ///< why it cannot determine what is asked; empty: it can
};
[[nodiscard]] CampaignForecast forecast_campaign(const configuration::Configuration& configuration);

/// The configured campaign, stop by stop, with the standard errors to be expected.
[[nodiscard]] PlanData plan_data(const configuration::Configuration& configuration);

}  // namespace vibrig
