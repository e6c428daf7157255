// What frames on the bus were: raw logs as samples, or as a whole campaign.
#pragma once

#include <string>
#include <vector>

#include "daemon/record/campaign_file.hpp"

namespace vibrig::record {

/// Samples that the frames of the campaign's raw log make, with the campaign's own signals.
/// `until`: time of the newest whole frame. Throws std::runtime_error.
[[nodiscard]] std::vector<drivers::Sample> samples_from_raw(const Campaign& campaign,
                                                            drivers::Time& until);

/// A campaign from candump logs alone. Dwells come from `dwells` (CSV, as the recorder writes it
/// beside its logs), signals from the configuration. Throws std::runtime_error.
[[nodiscard]] Campaign campaign_from_candump(const std::vector<std::string>& logs,
                                             const std::string& dwells,
                                             const std::string& configuration,
                                             const std::string& dbc);

}  // namespace vibrig::record
