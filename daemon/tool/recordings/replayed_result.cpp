#include "daemon/tool/recordings/replayed_result.hpp"

#include <optional>
#include <utility>

#include "daemon/dwells/live.hpp"
#include "daemon/record/campaign_file.hpp"
#include "daemon/report/paperwork.hpp"
#include "daemon/results/result_difference.hpp"
#include "estimator/commissioning/contradiction.hpp"
#include "estimator/filter/settings_check.hpp"
#include "estimator/uncertainty/verdict.hpp"

namespace vibrig::tool {

CampaignNames names_of(const record::Campaign& campaign) {
    const auto unit = report::paperwork_of(campaign);
    return {campaign.head.name, campaign.ended_utc_ns, unit.unit_type, unit.unit_serial};
}

std::string replayed_json(const record::Campaign& campaign, const record::ReplayResult& replayed,
                          const Assessed& found, const estimator::Settings& settings) {
    std::optional<dwells::Live> live;
    if (replayed.found)
        live = {*replayed.found, replayed.live,
                estimator::uncertainty::assess(settings, replayed.live)};
    const CampaignNames names = names_of(campaign);
    return result_json(replayed.result, found.assessed, campaign.head.simulated, nullptr,
                       live ? &*live : nullptr, found.spectrum ? &*found.spectrum : nullptr,
                       nullptr, &names);
}

std::string not_as_recorded(const record::Campaign& campaign, const record::ReplayResult& replayed,
                            const Assessed& found, const estimator::Settings& settings) {
    if (campaign.state != "finished" || campaign.result_json.empty()) return {};
    return result_difference(campaign.result_json,
                             replayed_json(campaign, replayed, found, settings));
}

std::string tell_doubts(const estimator::Settings& settings,
                        const std::vector<estimator::DwellMeans>& means,
                        estimator::Result& result) {
    auto& warnings = result.warnings;
    for (const auto& doubt : estimator::doubtful_keys(settings)) warnings.push_back(doubt.words());
    const auto found = estimator::commissioning::contradiction_of(settings, result.dwells, means);
    warnings.insert(warnings.end(), found.warnings.begin(), found.warnings.end());
    return found.first;
}

std::string doubt_replayed(const estimator::Settings& settings, record::ReplayResult& replayed,
                           estimator::uncertainty::Verdict& verdict) {
    const std::string contradiction = tell_doubts(settings, replayed.means, replayed.result);
    estimator::uncertainty::contradict(verdict, contradiction);
    return contradiction;
}

}  // namespace vibrig::tool
