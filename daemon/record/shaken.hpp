#pragma once

#include "daemon/configuration/configuration.hpp"
#include "daemon/record/campaign_file.hpp"
#include "estimator/spectrum/shaken.hpp"

namespace vibrig::record {

/// What its dwells shook with: random profiles and reported PSDs as `rig` has them at the platform,
/// sweeps from the recorded samples, those that were cut short left out.
[[nodiscard]] estimator::spectrum::Shaken shaken_of(const Campaign& campaign,
                                                    const configuration::Configuration& rig);

}  // namespace vibrig::record
