#pragma once

#include <vector>

#include "estimator/uncertainty/forward_model.hpp"
#include "estimator/uncertainty/signatures.hpp"

namespace vibrig::estimator::uncertainty {

/// Rows as the tests of fit take them, where a harmonic of the shaker falsifies the level (flagged,
/// with a frequency at which one aliases): their variance has what a level does that is off by it,
/// or else what it does to the rates would pass for a cubic term or an encoder zero. Empty: there
/// are none of these.
[[nodiscard]] std::vector<DwellRow> with_doubtful_levels(const Settings& settings,
                                                         const DwellTable& table,
                                                         const ForwardModel& model);

}  // namespace vibrig::estimator::uncertainty
