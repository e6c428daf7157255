#include "daemon/tool/recordings/replayed_result.hpp"

#include <optional>
#include <utility>

#include "daemon/dwells/live.hpp"
#include "daemon/record/campaign_file.hpp"
#include "daemon/results/result_difference.hpp"
#include "daemon/results/result_json.hpp"
#include "daemon/rt/dwell_order.hpp"

namespace vibrig::tool {

std::string replayed_json(const record::ReplayResult& replayed, const Assessed& found,
                          const estimator::Settings& settings, bool simulated) {
    std::optional<dwells::Live> live;
    if (replayed.found)
        live = {*replayed.found, replayed.live,
                estimator::uncertainty::assess(settings, replayed.live)};
    return result_json(replayed.result, found.assessed, simulated, nullptr, live ? &*live : nullptr,
                       found.spectrum ? &*found.spectrum : nullptr);
}

std::string not_as_recorded(const record::Campaign& campaign, const record::ReplayResult& replayed,
                            const Assessed& found, const estimator::Settings& settings) {
    if (campaign.state != "finished" || campaign.result_json.empty()) return {};
    return result_difference(campaign.result_json,
                             replayed_json(replayed, found, settings, campaign.head.simulated));
}

RigDoubts doubts_of(const record::Campaign& campaign, const estimator::Settings& settings) {
    RigDoubts doubts(settings);
    for (const auto& dwell : record::recorded_dwells(campaign)) {
        doubts.begin_dwell();
        if (dwell.order->sweep.any()) continue;
        for (std::size_t i = dwell.first; i < dwell.first + dwell.count; ++i)
            doubts.add(
                rt::measurement_of(campaign.samples[i], dwell.order->from, dwell.order->zero_g));
    }
    return doubts;
}

std::string doubt_replayed(const record::Campaign& campaign, const estimator::Settings& settings,
                           record::ReplayResult& replayed,
                           estimator::uncertainty::Verdict& verdict) {
    // What is merely unusual of the configuration is no part of the daemon's result.
    auto warned = replayed.result;
    const std::string contradiction = doubts_of(campaign, settings).tell(warned, replayed.rows);
    if (contradiction.empty()) return {};
    replayed.result = std::move(warned);
    contradict(verdict, contradiction);
    return contradiction;
}

}  // namespace vibrig::tool
