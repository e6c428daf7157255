#include "daemon/app/campaign_forecast.hpp"

#include <algorithm>

#include "daemon/campaign/campaign.hpp"
#include "daemon/plan/forecast.hpp"

namespace vibrig {

namespace {

double period_s(const configuration::Configuration& c) {
    return drivers::to_seconds(c.assembler.sample_period);
}

std::vector<plan::PlannedRun> runs_of(const campaign::Settings& campaign, double transmission) {
    std::vector<plan::PlannedRun> runs;
    const auto add = [&](const std::array<double, 3>& position, double table_g) {
        runs.push_back({position, table_g * transmission, table_g, 1});
    };
    for (const auto& stop : campaign.stops) {
        const bool apart = stop.verify || stop.random || stop.sweep.any() ||
                           (stop.frequency_hz > 0 && stop.table_g > 0 &&
                            !estimator::at_reference(campaign.rig, stop.frequency_hz));
        if (!apart) add(stop.position_deg, stop.table_g);
    }
    if (!runs.empty()) return runs;
    for (const double table_g : campaign.table_g) {
        for (const auto& position : campaign.positions_deg) add(position, table_g);
    }
    return runs;
}

}  // namespace

std::optional<plan::AdaptivePlan> adaptive_plan(const configuration::Configuration& c) {
    if (!c.campaign.adaptive) return std::nullopt;
    plan::AdaptiveSettings settings;
    settings.table_g = c.campaign.table_g;
    settings.target = {c.campaign.target_bias, c.campaign.target_linear,
                       c.campaign.target_quadratic};
    settings.timing.dwell_s = c.campaign.dwell_s;
    settings.timing.settle_s = c.campaign.settle_s;
    settings.timing.ramp_s = c.campaign.ramp_s;
    const campaign::StageTimes stages = campaign::stage_times(c.campaign);
    settings.levelling_s = stages.levelling_s;
    settings.timing.look_s = stages.look_s;
    settings.closing_s = stages.closing_s;
    settings.time_limit_s = c.campaign.time_limit_s;
    settings.period_s = period_s(c);
    for (std::size_t i = 0; i < 3; ++i) {
        settings.limits.low[i] = c.gimbal.travel_deg[i][0];
        settings.limits.high[i] = c.gimbal.travel_deg[i][1];
    }
    return plan::AdaptivePlan(c.estimator, settings);
}

PlanData plan_data(const configuration::Configuration& c) {
    const campaign::Settings& campaign = c.campaign;
    PlanData plan;
    plan.name = campaign.name;
    plan.adaptive = campaign.adaptive;
    plan.dwell_s = campaign.dwell_s;
    plan.frequency_hz = campaign.frequency_hz;
    if (campaign.adaptive) {
        const std::array by_order{campaign.target_bias, campaign.target_linear,
                                  campaign.target_quadratic};
        for (std::size_t i = 0; i < estimator::kParameters; ++i)
            plan.target[i] = by_order[estimator::order_of(i)];
        return plan;
    }
    int run = 1;
    std::vector<std::pair<double, double>> levels;
    for (const auto& stop : campaign.stops) {
        // Each level is a run, as in the campaign.
        const std::pair one{stop.table_g, stop.kind()};
        auto level = std::ranges::find(levels, one);
        if (level == levels.end()) level = levels.insert(level, one);
        plan.stops.push_back({static_cast<int>(level - levels.begin()) + 1,
                              static_cast<int>(plan.stops.size()) + 1, stop.position_deg,
                              stop.table_g});
    }
    if (campaign.stops.empty()) {
        for (const double table_g : campaign.table_g) {
            int position = 0;
            for (const auto& at : campaign.positions_deg)
                plan.stops.push_back({run, ++position, at, table_g});
            ++run;
        }
    }
    plan.sigma = plan::forecast(c.estimator, runs_of(campaign, c.estimator.transmission),
                                campaign.dwell_s, period_s(c))
                     .sigma;
    return plan;
}

CampaignForecast forecast_campaign(const configuration::Configuration& c) {
    if (c.campaign.adaptive) return {"adaptive campaign: " + adaptive_plan(c)->outlook().words, {}};
    const auto forecast = plan::forecast(c.estimator, runs_of(c.campaign, c.estimator.transmission),
                                         c.campaign.dwell_s, period_s(c));
    CampaignForecast said{plan::forecast_table(forecast), {}};
    if (!forecast.warning.empty()) said.words += "warning: " + forecast.warning + '\n';
    if (!forecast.identifies_all) {
        said.words += "this campaign does not determine everything: " + forecast.refusal + '\n';
        if (c.campaign.identify_all) {
            said.refusal = "campaign: " + forecast.refusal +
                           "; campaign.identify = \"what-it-can\" runs it all the same";
        }
    }
    return said;
}

}  // namespace vibrig
