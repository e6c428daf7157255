#pragma once

#include <cstdint>

#include "estimator/zeros/calibration.hpp"

namespace vibrig::estimator::zeros {

/// A unit on the azimuth axis with what is wrong with it. The truth is a full strapdown: the
/// turned, tilted unit on the turning Earth, not the error model. The noise is that of the
/// settings.
struct UnitErrors {
    Triple zero_mg{5, -5, 5};
    Triple scale{};  ///< of the accelerometers, 1
    /// Row i: what the instrument on axis i shows of x, y, z besides; gains on the diagonal; 1.
    std::array<Triple, 3> accelerometer_cross{}, gyro_cross{};
    Triple gyro_bias_deg_h{0.1, -0.1, 0.1};
    double tilt_east_deg = 0.1, tilt_north_deg = -0.1, azimuth_deg = 0.5;  ///< wrongly assumed
    double vibration_g = 0;  ///< peak, along the vertical, at 15 Hz
};

class UnitSimulation {
  public:
    /// `real_rate` over planned rate of the azimuth; 0 stands.
    UnitSimulation(const CalibrationSettings& settings, const UnitErrors& errors, double period_s,
                   std::uint64_t seed, double real_rate = 1);
    ~UnitSimulation();
    UnitSimulation(UnitSimulation&&) noexcept;

    /// The next increment; the first carries the start only.
    [[nodiscard]] Increment next();

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// From the start of the plan to its end.
[[nodiscard]] Calibration simulate(const CalibrationSettings& settings, const UnitErrors& errors,
                                   double period_s, std::uint64_t seed);

}  // namespace vibrig::estimator::zeros
