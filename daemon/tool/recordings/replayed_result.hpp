#pragma once

#include <string>

#include "daemon/record/replay.hpp"
#include "daemon/results/spectrum_result.hpp"
#include "daemon/tool/analysis/rig_doubts.hpp"

namespace vibrig::tool {

/// What a replay gives, as the daemon writes it into the recording.
[[nodiscard]] std::string replayed_json(const record::ReplayResult& replayed, const Assessed& found,
                                        const estimator::Settings& settings, bool simulated);

/// In words, where the recording's own result is not what its replay gives; empty: nowhere, or it
/// is not compared: a campaign that did not finish has one of less than was recorded.
[[nodiscard]] std::string not_as_recorded(const record::Campaign& campaign,
                                          const record::ReplayResult& replayed,
                                          const Assessed& found,
                                          const estimator::Settings& settings);

/// A campaign's dwells as they were fed, its sweeps left out.
[[nodiscard]] RigDoubts doubts_of(const record::Campaign& campaign,
                                  const estimator::Settings& settings);
/// Where the recording contradicts the configuration, the replay's result has warnings of it and
/// the verdict is no. The contradiction; empty: none.
std::string doubt_replayed(const record::Campaign& campaign, const estimator::Settings& settings,
                           record::ReplayResult& replayed,
                           estimator::uncertainty::Verdict& verdict);

}  // namespace vibrig::tool
