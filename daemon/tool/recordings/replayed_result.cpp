#include "daemon/tool/recordings/replayed_result.hpp"

#include <optional>
#include <utility>

#include "daemon/dwells/live.hpp"
#include "daemon/record/campaign_file.hpp"
#include "daemon/results/result_difference.hpp"
#include "daemon/results/result_json.hpp"
#include "estimator/commissioning/contradiction.hpp"
#include "estimator/uncertainty/verdict.hpp"

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

std::string doubt_replayed(const estimator::Settings& settings, record::ReplayResult& replayed,
                           estimator::uncertainty::Verdict& verdict) {
    const auto found = estimator::commissioning::contradiction_of(settings, replayed.result.dwells,
                                                                  replayed.means);
    auto& warnings = replayed.result.warnings;
    warnings.insert(warnings.end(), found.warnings.begin(), found.warnings.end());
    estimator::uncertainty::contradict(verdict, found.first);
    return found.first;
}

}  // namespace vibrig::tool
