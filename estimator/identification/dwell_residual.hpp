#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "estimator/filter/settings.hpp"
#include "estimator/filter/vibration_moment.hpp"

namespace vibrig::estimator {

/// Mean of the encoder angles over one block of a dwell, of the samples that the filter used.
struct AngleBlock {
    std::size_t number = 0;             ///< of the block in the dwell
    double time_s = 0;                  ///< mean of the samples' times
    std::array<double, 3> angle_rad{};  ///< raw encoder angles, not wrapped within the dwell
};

/// What the drift model leaves of a dwell, as angles about the input axis of each gyro.
struct DwellResidual {
    std::array<std::vector<double>, 3> angle_arcsec;  ///< gyro x, y, z; one for each block
    /// Variance of the encoders' noise, turned into the gyros' axes, over that of one encoder.
    std::array<double, 3> noise_gain{1, 1, 1};
};

/// The angles minus the model's with the given coefficients (in the order of parameter_names()) and
/// vibration, which starts at the first block. Errors of the coefficients leave a rate.
[[nodiscard]] DwellResidual dwell_residual(const Settings& settings,
                                           const std::array<double, kParameters>& coefficients,
                                           const VibrationMoment& vibration,
                                           std::span<const AngleBlock> blocks);

}  // namespace vibrig::estimator
