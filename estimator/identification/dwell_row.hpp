#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "estimator/filter/coefficients.hpp"
#include "estimator/filter/vibration_moment.hpp"
#include "estimator/level/harmonics.hpp"

namespace vibrig::estimator {

/// Between two dwells whose times have no clock in common, s.
inline constexpr double kAssumedPause_s = 60;

/// All that one dwell says of the coefficients and of what the model leaves out: the mean drift of
/// each gyro about its input axis, Earth rate taken out, and how it changes along the dwell.
struct DwellRow {
    using Vector = std::array<double, kGyros>;
    using Matrix = std::array<Vector, kGyros>;
    using Regression = std::array<std::array<double, kGroups>, kGyros>;  ///< groups in filter order

    int run = 0, position = 0;
    double table_g = -1;  ///< commanded; negative: not known
    double middle_s = 0;  ///< on the clock of DwellInfo::begin_s, or of the dwell without one
    bool common_clock = false;
    bool after_power_loss = false;  ///< the gyros were without power since the row before
    double duration_s = 0;
    std::array<double, 3> angles{};  ///< gimbals, mean over the dwell, rad
    VibrationMoment vibration;
    double frequency_hz = 0;  ///< 0 at rest
    Vector rate{};            ///< y, deg/h
    Matrix variance{};
    Regression regressors{};  ///< h as it weighs in `rate`
    /// Ramp of the drift within the dwell, deg/h per 100 s, the mean left free.
    Vector ramp{};
    Matrix ramp_variance{};
    Regression ramp_regressors{};
    double nis_per_dof = 0, innovation_correlation = 0;
    std::uint32_t used = 0;
    double sync_arcsec = 0;  ///< motion of the angles in step with the vibration
    /// Shares of the vibration's mean square, as the accelerometers show it: harmonics of
    /// frequency_hz.
    Harmonics::Shares harmonics{};
    bool flagged = false;       ///< and not merely followed
    double commanded_hz = 0;    ///< 0: nobody said
    bool held_out = false;      ///< as DwellInfo
    bool random = false;        ///< random vibration: `regressors` are with its profile's level
    std::uint16_t profile = 0;  ///< of random vibration: as RandomVibration
    std::uint32_t psd = 0;      ///< likewise, as PlayedRandom::place; 0: as its profile has it
    double relative_error = 0;  ///< of the vibration's mean square, 1 sigma; known of random alone
    bool apart = false;         ///< held out, or of another frequency: the coefficients lack it
};

/// Those that the coefficients at the reference frequency rest on.
[[nodiscard]] std::vector<DwellRow> without_apart(const std::vector<DwellRow>& rows);

}  // namespace vibrig::estimator
