#pragma once

#include <string>
#include <vector>

#include "daemon/record/replay.hpp"
#include "daemon/results/result_json.hpp"
#include "daemon/results/spectrum_result.hpp"

namespace vibrig::tool {

/// Of which campaign and unit a recording is.
[[nodiscard]] CampaignNames names_of(const record::Campaign& campaign);

/// What a replay gives, as the daemon writes it into the recording.
[[nodiscard]] std::string replayed_json(const record::Campaign& campaign,
                                        const record::ReplayResult& replayed, const Assessed& found,
                                        const estimator::Settings& settings);

/// In words, where the recording's own result is not what its replay gives; empty: nowhere, or it
/// is not compared: a campaign that did not finish has one of less than was recorded.
[[nodiscard]] std::string not_as_recorded(const record::Campaign& campaign,
                                          const record::ReplayResult& replayed,
                                          const Assessed& found,
                                          const estimator::Settings& settings);

/// Warnings of the result: what is unusual of the configuration, and where the recording
/// contradicts it. The first contradiction; empty: none.
std::string tell_doubts(const estimator::Settings& settings,
                        const std::vector<estimator::DwellMeans>& means, estimator::Result& result);

/// The same, as the daemon at a campaign's end: where they contradict the verdict is no.
std::string doubt_replayed(const estimator::Settings& settings, record::ReplayResult& replayed,
                           estimator::uncertainty::Verdict& verdict);

}  // namespace vibrig::tool
