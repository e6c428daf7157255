#pragma once

#include <array>
#include <string>
#include <vector>

#include "estimator/identification/result.hpp"
#include "tests/plant/truth.hpp"

namespace vibrig::estimator::testing {

/// Levels at the table and the order of the dwells, as vibrig-plant takes it.
struct Schedule {
    std::vector<double> table_g;
    std::string order;
};
[[nodiscard]] Schedule balanced_schedule();
[[nodiscard]] Schedule balanced_schedule_with_rest();
[[nodiscard]] Schedule sequential_schedule();

/// A campaign of the independent plant, as the identification takes its samples.
struct FromSamples {
    Result result;
    std::array<double, kParameters> truth{};  ///< mean over the samples, as the rig had them
};
/// Dwells of 100 s, vibrating at the settings' frequency.
[[nodiscard]] FromSamples from_samples(const Settings& settings, const plant::Truth& truth,
                                       const Schedule& schedule);

/// Without any noise.
[[nodiscard]] plant::Truth quiet_rig();

}  // namespace vibrig::estimator::testing
