#pragma once

#include <span>

#include "tests/plant/truth.hpp"

namespace vibrig::plant {

/// The inertial platform in its gimbals: Tang et al. 2009, original model, the vibration explicit
/// and not averaged. Reference frame north, up, east; gimbals outer about x, inner about y, azimuth
/// about z. Written from the geometry of the gimbals, not from the matrices the estimator uses, so
/// that an error cannot cancel.
class PlatformModel {
  public:
    explicit PlatformModel(const Truth& truth);

    /// Angles of the gimbals: alpha, beta, gamma in rad; they are not wrapped while the platform
    /// drifts.
    [[nodiscard]] const Vec3& angles() const noexcept { return angles_; }
    void set_angles(const Vec3& rad) noexcept { angles_ = rad; }

    /// A vector of the reference frame seen in platform axes.
    [[nodiscard]] static Vec3 to_platform(const Vec3& angles, const Vec3& reference) noexcept;
    [[nodiscard]] Vec3 up_in_platform() const noexcept { return to_platform(angles_, up_); }
    [[nodiscard]] Vec3 up_at(const Vec3& angles) const noexcept { return to_platform(angles, up_); }
    /// Rate of the Earth in platform axes, deg/h.
    [[nodiscard]] Vec3 earth_rate_in_platform(const Vec3& angles) const noexcept {
        return to_platform(angles, earth_);
    }
    /// Drift of the three gyros in deg/h, without drift_sign. `a1` is the platform's vibration
    /// along up in g.
    [[nodiscard]] Vec3 gyro_drift(const Vec3& up_platform, double a1) const noexcept;
    /// Rate of the Earth in the reference frame, deg/h.
    [[nodiscard]] const Vec3& earth_rate() const noexcept { return earth_; }
    /// d angles / dt in rad/s; `extra` is a rate of the platform in its axes, deg/h (noise,
    /// torquing).
    [[nodiscard]] Vec3 angle_rates(const Vec3& angles, double a1, const Vec3& extra) const noexcept;

    /// Runge-Kutta steps of `step_s`; `a1` holds the vibration at both ends and the middle of every
    /// step (2 n + 1).
    void advance(double step_s, std::span<const double> a1, const Vec3& extra) noexcept;

  private:
    Vec3 angles_{};
    Vec3 up_{};     ///< in the reference frame
    Vec3 earth_{};  ///< in the reference frame, deg/h
    std::array<GyroCoefficients, 3> coefficients_;
    std::array<std::array<Axis, 3>, 3> gyro_axes_;
    double drift_sign_;
};

}  // namespace vibrig::plant
