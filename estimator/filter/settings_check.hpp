#pragma once

#include "estimator/filter/settings.hpp"

namespace vibrig::estimator {

/// Throws SettingsError at the first setting that cannot work.
void check(const Settings& settings);

}  // namespace vibrig::estimator
