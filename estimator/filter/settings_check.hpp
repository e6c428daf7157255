#pragma once

#include <string>
#include <vector>

#include "estimator/filter/settings.hpp"

namespace vibrig::estimator {

/// Throws SettingsError at the first setting that cannot work.
void check(const Settings& settings);

/// Gyro axes that are permitted but hardly meant: an input axis that is not the gyro's own (or two
/// gyros' at once), a left-handed triad of input, output and spin axis.
struct DoubtfulAxes {
    std::string key;  ///< "platform.gyro_y_axes", with [0] for the input axis
    std::string found, expected;
};
[[nodiscard]] std::vector<DoubtfulAxes> doubtful_axes(const Settings& settings);

}  // namespace vibrig::estimator
