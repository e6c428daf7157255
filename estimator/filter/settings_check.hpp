#pragma once

#include <array>
#include <string>
#include <vector>

#include "estimator/filter/settings.hpp"

namespace vibrig::estimator {

/// Throws SettingsError at the first setting that cannot work.
void check(const Settings& settings);

[[nodiscard]] double determinant(const std::array<std::array<double, 3>, 3>& m) noexcept;

/// What is permitted but hardly meant.
struct DoubtfulKey {
    std::string key;  ///< "platform.gyro_y_axes", with [0] for the input axis
    std::string found, expected;
    [[nodiscard]] std::string words() const {
        return key + ": found " + found + ", expected " + expected;
    }
};
/// Gyro axes: an input axis that is not the gyro's own (or two gyros' at once), a left-handed triad
/// of input, output and spin axis. Motion across the vertical that is neither measured nor
/// declared.
[[nodiscard]] std::vector<DoubtfulKey> doubtful_keys(const Settings& settings);

}  // namespace vibrig::estimator
