#include "daemon/configuration/key.hpp"
#include "daemon/configuration/rules.hpp"

namespace vibrig::configuration {

namespace {

using C = Configuration;

constexpr std::size_t kMostPositions = 10'000;
constexpr std::size_t kMostRuns = 100;

}  // namespace

void add_campaign_keys(std::vector<Key>& keys) {
    keys.push_back(text(
        "campaign.name", "1 to 64 characters", "names the results", campaign_name_rule,
        [](C & c) -> auto& { return c.campaign.name; }));
    keys.push_back(positions(
        "campaign.positions_deg", kMostPositions,
        "gimbal positions of every run (default: Tang et al. 2009, table 1)",
        [](C & c) -> auto& { return c.campaign.positions_deg; }));
    keys.push_back(numbers(
        "campaign.table_g", "g", {0, 1000}, kMostRuns,
        "peak acceleration at the table, one run each; 0: at rest",
        [](C & c) -> auto& { return c.campaign.table_g; }));
    keys.push_back(text(
        "campaign.plan", "a file",
        "plan of `vibrig plan -o`, in place of positions_deg and table_g; empty: none", path_rule,
        [](C & c) -> auto& { return c.campaign.plan; }));
    keys.push_back(choice<bool>(
        "campaign.identify", {{"all", true}, {"what-it-can", false}},
        "all: a campaign that cannot determine all 30 coefficients is not armed",
        [](C & c) -> auto& { return c.campaign.identify_all; }));
    keys.push_back(boolean(
        "campaign.adaptive",
        "dwells chosen one by one, at the levels table_g, until the standard "
        "errors are down to targets",
        [](C & c) -> auto& { return c.campaign.adaptive; }));
    keys.push_back(number("campaign.targets.bias", "deg/h", {0, 1000},
                          "standard error to reach; 0: any",
                          [](C& c) -> double& { return c.campaign.target_bias; }));
    keys.push_back(number("campaign.targets.linear", "deg/h/g", {0, 1000},
                          "standard error to reach; 0: any",
                          [](C& c) -> double& { return c.campaign.target_linear; }));
    keys.push_back(number("campaign.targets.quadratic", "deg/h/g^2", {0, 1000},
                          "standard error to reach; 0: any",
                          [](C& c) -> double& { return c.campaign.target_quadratic; }));
    keys.push_back(number("campaign.time_limit_s", "s", {0, 1e7},
                          "an adaptive campaign ends before it; 0: none",
                          [](C& c) -> double& { return c.campaign.time_limit_s; }));
    keys.push_back(number("campaign.dwell_s", "s", {2, 86'400}, "recorded at each position",
                          [](C& c) -> double& { return c.campaign.dwell_s; }));
    keys.push_back(number("campaign.settle_s", "s", {2, 3600},
                          "waited after the ramp before recording",
                          [](C& c) -> double& { return c.campaign.settle_s; }));
    keys.push_back(number("campaign.ramp_s", "s", {0.1, 600}, "from rest to amplitude, and back",
                          [](C& c) -> double& { return c.campaign.ramp_s; }));
    keys.push_back(number("campaign.ready_timeout_s", "s", {1, 86'400},
                          "for the platform to be ready and its temperature steady",
                          [](C& c) -> double& { return c.campaign.ready_timeout_s; }));
    keys.push_back(number("campaign.temperature_window_s", "s", {0, 86'400},
                          "over which the temperature must be steady; 0: not asked",
                          [](C& c) -> double& { return c.campaign.temperature_window_s; }));
    keys.push_back(number("campaign.temperature_band_c", "degC", {0.001, 100},
                          "largest spread of the temperature within the window",
                          [](C& c) -> double& { return c.campaign.temperature_band_c; }));
    keys.push_back(number("campaign.amplitude_tolerance", "", {0.001, 1},
                          "measured against commanded amplitude after the ramp, relative",
                          [](C& c) -> double& { return c.campaign.amplitude_tolerance; }));
    keys.push_back(number("campaign.stop_timeout_s", "s", {0.1, 600}, "from stop to rest",
                          [](C& c) -> double& { return c.campaign.stop_timeout_s; }));
    keys.push_back(number("campaign.resonance_hz", "Hz", {0, 2000},
                          "of the isolators; 0: from frequency and transmission",
                          [](C& c) -> double& { return c.campaign.resonance_hz; }));
    keys.push_back(text(
        "campaign.results", "a folder", "for result.json; empty: none written", path_rule,
        [](C & c) -> auto& { return c.results; }));
}

}  // namespace vibrig::configuration
