#pragma once

#include <cstddef>
#include <vector>

#include "estimator/filter/measurement.hpp"
#include "estimator/identification/identification.hpp"
#include "tests/plant/recording.hpp"

namespace vibrig::estimator::spectrum::testing {

/// As a filter takes it.
[[nodiscard]] Measurement measurement_of(const plant::PlannedSample& sample) noexcept;

/// What is played in a run, `stated` times its mean square; nothing: a sine, or rest.
[[nodiscard]] RandomVibration played_in(const plant::Truth& truth, const plant::CampaignPlan& plan,
                                        std::size_t run, double stated = 1);

/// Rows of a simulated campaign, dwell by dwell through a filter of its own, in the plan's order.
/// Where a dwell gives none a test fails.
[[nodiscard]] std::vector<DwellRow> rows_through(const plant::Truth& truth,
                                                 const plant::CampaignPlan& plan,
                                                 const Settings& settings);

}  // namespace vibrig::estimator::spectrum::testing
