#pragma once

#include "estimator/filter/declared.hpp"

namespace vibrig::estimator::uncertainty {

/// Throws SettingsError when a standard uncertainty is none, or correlations name no input, or two
/// that cannot be correlated so.
void check(const Inputs& inputs);

}  // namespace vibrig::estimator::uncertainty
