#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "estimator/zeros/slew_plan.hpp"

namespace vibrig::estimator::zeros {

inline constexpr double kMicro = 1e-6;
inline constexpr double kDeclaredCross = 2.4e-4;  ///< rad, 50 arcsec
using Triple = std::array<double, 3>;

struct Noise {
    double angle_random_walk = 0.01;     ///< deg/sqrt(h)
    double velocity_random_walk = 2e-5;  ///< g/sqrt(Hz)
    double velocity_reference = 0.005;   ///< m/s, per update
    double position_reference = 0.01;    ///< m, per update
    /// They are upper bounds of how still a unit stands: smaller innovations are no fault.
    bool reference_is_bound = false;
    double gyro_drift = 0;               ///< of the biases, deg/h per sqrt(h)
    double accelerometer_drift = 0;      ///< of the zeros, mg per sqrt(h)
    double scale_factor = 100 * kMicro;  ///< of the vertical accelerometer, not known better
    /// Tilt of an accelerometer towards another axis as the gyros see it, rad, not known better: 1
    /// g of it is in x and y as long as z has been up only, and a unit off level has its share of
    /// it.
    double misalignment = kDeclaredCross;
};

/// Before the first update, 1 sigma.
struct Initial {
    double tilt_deg = 1, azimuth_deg = 1;
    double velocity_mps = 0.1, position_m = 1;
    double gyro_bias_deg_h = 0.2, zero_mg = 5;
    double gain = 1e-3;  ///< of the level accelerometers, 1
};

struct CalibrationSettings {
    Site site;
    SlewPlan plan;
    Noise noise;
    Initial initial;
    Triple lever_arm_m{};  ///< from the azimuth axis to the unit, body axes
    /// Of the first level axis (z up or down: x, y up or down: z) at azimuth 0, from east,
    /// counter-clockwise about up. What it is off by goes into the level gyros' biases, and is
    /// found no better than `initial.azimuth_deg` lets it.
    double heading_deg = 0;
    double update_s = 1;
    Triple target_mg{0.15, 0.05, 0.01};  ///< of the two level axes and of the upright one
    double saturation_g = 10;            ///< of an accelerometer
    double vibration_limit_g = 0.01;     ///< standard deviation within a second
    int upright = 2;                     ///< platform axis about which it is turned
    bool inverted = false;               ///< that axis down instead of up
    bool allow_unobservable = false;     ///< for a control run at rest
};

/// Over the time since the last one.
struct Increment {
    double time_s = 0;
    Triple turn_rad{};
    Triple velocity_mps{};
    double azimuth_rad =
        0;  ///< read-out, from heading_deg, positive about up; NaN: none. May be late.
    Triple reference_velocity_mps{};  ///< of the azimuth axis, east north up; 0 on the rig
    Triple reference_position_m{};
};

struct AxisResult {
    double zero_mg = 0;   ///< level: zero plus misalignment, upright: plus scale error, times 1 g
    double sigma_mg = 0;  ///< of what is called zero: with the share of what is not observable
    double filter_sigma_mg = 0;
    double movement_mg = 0;  ///< of the estimate within the last sweep
    std::optional<double> converged_s;
};

struct InnovationStatistic {
    double mean_nis = 0;       ///< of the last whole block of 60 updates, 6 when consistent
    double low = 0, high = 0;  ///< band of the mean; low is 0 where the reference is a bound
    std::size_t blocks = 0, outside = 0;
    Triple velocity_ratio{}, position_ratio{};  ///< of squares to expected squares, last block
};

/// What the filter knows at its end, in the order level, level, upright of `platform_axis`, all in
/// mg: three zeros, then of each accelerometer what it shows of 1 g along either level axis.
struct Joint {
    static constexpr std::size_t kSize = 9;
    std::array<double, kSize> value{};
    std::array<std::array<double, kSize>, kSize> covariance{};
    std::array<double, kSize> prior{};  ///< 1 sigma before the run
};

/// Platform axis at a place of the order level, level, upright: that of the platform, begun after
/// the upright axis.
[[nodiscard]] constexpr std::size_t platform_axis(int upright, std::size_t place) {
    return (static_cast<std::size_t>(upright) + 1 + place) % 3;
}

struct CalibrationResult {
    int upright = 2;        ///< as in the settings
    bool inverted = false;  ///< as in the settings
    std::array<AxisResult, 3> axis;
    Triple gyro_bias_deg_h{};
    Triple gyro_sigma_deg_h{};
    std::array<Triple, 3> covariance_mg2{};         ///< of the zeros, with what is not observable
    std::array<Triple, 3> filter_covariance_mg2{};  ///< without
    Joint joint;
    /// Gain of the vertical gyro against the azimuth read-out, 1; none without a read-out.
    std::optional<double> gyro_gain;
    InnovationStatistic innovation;
    double time_s = 0;
    std::size_t updates = 0, gaps = 0;
    bool valid = false;
    std::vector<std::string> problems;  ///< why not
    std::vector<std::string> notes;
};

/// A point of the history, one per update: the two level axes (after the upright one in turn), then
/// the upright one; x, y, z where z is upright.
struct CalibrationTrace {
    double time_s = 0;
    Triple zero_mg{};
    Triple sigma_mg{};
};

/// The 15-state filter in closed loop over the strapdown mechanisation, with the checks of its
/// input. The constructor throws ZeroError if the plan cannot work.
class Calibration {
  public:
    explicit Calibration(const CalibrationSettings& settings);
    ~Calibration();
    Calibration(Calibration&&) noexcept;
    Calibration& operator=(Calibration&&) noexcept;

    /// False once the run has been given up.
    bool add(const Increment& increment);
    [[nodiscard]] bool given_up() const noexcept;
    [[nodiscard]] CalibrationResult result() const;
    [[nodiscard]] const std::vector<CalibrationTrace>& trace() const noexcept;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace vibrig::estimator::zeros
