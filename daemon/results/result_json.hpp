#pragma once

#include <cstdint>
#include <string>

#include "daemon/dwells/live.hpp"
#include "daemon/results/spectrum_result.hpp"
#include "estimator/identification/result.hpp"
#include "estimator/uncertainty/monte_carlo.hpp"
#include "estimator/uncertainty/population.hpp"

namespace vibrig::tool {

/// What is known of the unit's type.
struct KnownType {
    std::string name;
    estimator::uncertainty::Population of;
};

/// Of which campaign and unit a result is: the file may be all that a reader has.
struct CampaignNames {
    std::string name;
    std::int64_t ended_utc_ns = 0;       ///< 0: not known
    std::string unit_type, unit_serial;  ///< empty: not stated
};

/// The JSON form of a result, as `vibrig identify --json` prints it and vibrigd writes it to
/// result.json: one line, keys in fixed order, numbers that read back exactly. What is not
/// observable or does not exist is null, never NaN. Without an assessment there is no verdict, no
/// budget, and `value` is that of a constant bias. `simulated`: the rig was a program. `drawn`: the
/// Monte Carlo, if there was one. `live`: what the result replaced, if it was identified anew.
/// `spectrum`: over frequency. `type`: the result is given together with it as well. `campaign`:
/// whose it is; a table of samples by anyone has none.
[[nodiscard]] std::string result_json(
    const estimator::Result& result, const estimator::uncertainty::Assessment& assessed = {},
    bool simulated = false, const estimator::uncertainty::MonteCarlo* drawn = nullptr,
    const dwells::Live* live = nullptr, const SpectrumResult* spectrum = nullptr,
    const KnownType* type = nullptr, const CampaignNames* campaign = nullptr);

/// True if all 30 coefficients are determined one by one.
[[nodiscard]] bool all_observable(const estimator::Result& result);

}  // namespace vibrig::tool
