#pragma once

#include <string>
#include <vector>

#include "estimator/filter/settings.hpp"
#include "estimator/identification/dwell_means.hpp"
#include "estimator/identification/result.hpp"

namespace vibrig::estimator::commissioning {

/// What of a campaign contradicts the configuration that it is identified with: gravity, Earth rate
/// and what 30 coefficients cannot explain (docs/commissioning.md).
struct Contradiction {
    std::string first;                  ///< empty: the configuration fits
    std::vector<std::string> warnings;  ///< all of them, and which keys would explain them
};
/// `dwells` and `means` as the identification has them, one for one. Throws SettingsError.
[[nodiscard]] Contradiction contradiction_of(const Settings& settings,
                                             const std::vector<DwellSummary>& dwells,
                                             const std::vector<DwellMeans>& means);
/// The first of it alone, for whoever judges thousands: without the search for what would explain
/// it.
[[nodiscard]] std::string first_contradiction(const Settings& settings,
                                              const std::vector<DwellSummary>& dwells,
                                              const std::vector<DwellMeans>& means);

}  // namespace vibrig::estimator::commissioning
