#pragma once

#include <vector>

#include "estimator/identification/identification.hpp"
#include "tests/plant/recording.hpp"

namespace vibrig::estimator::spectrum::testing {

/// Rows of a simulated campaign, dwell by dwell through a filter of its own, in the plan's order.
/// Where a dwell gives none a test fails.
[[nodiscard]] std::vector<DwellRow> rows_through(const plant::Truth& truth,
                                                 const plant::CampaignPlan& plan,
                                                 const Settings& settings);

}  // namespace vibrig::estimator::spectrum::testing
