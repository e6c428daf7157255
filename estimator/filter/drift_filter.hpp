#pragma once

#include <Eigen/Core>
#include <array>

#include "estimator/filter/drift_model.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/measurement.hpp"
#include "estimator/filter/settings.hpp"
#include "estimator/filter/ud_filter.hpp"
#include "estimator/filter/vibration_moment.hpp"

namespace vibrig::estimator {

/// Measurement and process noise of the filter in its own units.
struct FilterNoise {
    double angle_variance = 0;  ///< of one encoder reading, arcsec^2, quantisation included
    double walk = 0;            ///< q = (60 N)^2, arcsec^2/s
    /// sqrt of the gyro's own q over `walk`.
    std::array<double, 3> gyro_share{1, 1, 1};

    [[nodiscard]] static FilterNoise of(const Settings& settings) noexcept;
    [[nodiscard]] static FilterNoise of(const NoiseLevels& levels) noexcept;
};

/// The filter over the dwells of one or more runs: time steps by the averaged model, innovation
/// gate, re-initialisation. Angles given are gimbal angles; never allocates, never throws.
class DriftFilter {
  public:
    DriftFilter(const Settings& settings, const ParameterArray& sigma);

    void set_noise(const FilterNoise& noise) noexcept { noise_ = noise; }
    /// The next sample starts the angles afresh.
    void begin_dwell() noexcept;
    /// The biases have walked since the last dwell, by this variance, (deg/h)^2; and the next
    /// sample starts the angles afresh.
    void begin_dwell_after_walk(double variance) noexcept;
    /// One reading at `time_s`, later than the one before.
    StepResult step(double time_s, const Eigen::Vector3d& angles_rad,
                    const VibrationMoment& vibration) noexcept;

    [[nodiscard]] const UdFilter& state() const noexcept { return filter_; }
    /// Takes back what was learnt since `state` was copied.
    void restore(const UdFilter& state) noexcept { filter_ = state; }
    /// Present gimbal angles, rad.
    [[nodiscard]] Eigen::Vector3d angles() const noexcept;
    /// North, up and east at the last time step, platform axes: the level that spikes do not move.
    [[nodiscard]] const Eigen::Matrix3d& level() const noexcept { return level_; }

  private:
    void predict(double dt, const VibrationMoment& vibration) noexcept;

    Kinematics kinematics_;
    DriftModel model_;
    FilterNoise noise_;
    double gate_;
    UdFilter filter_;
    Eigen::Matrix3d level_;
    double time_s_ = 0;
    int gated_in_a_row_ = 0;
    bool started_ = false;
};

}  // namespace vibrig::estimator
