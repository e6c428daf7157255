#pragma once

#include <Eigen/Core>
#include <array>

#include "estimator/filter/angles.hpp"
#include "estimator/filter/settings.hpp"

namespace vibrig::estimator {

inline constexpr double kEarthRateDegPerHour = 15.041067;
/// The gimbals are singular at 90 deg of the inner angle; measurements beyond this are refused.
inline constexpr double kMaxInnerAngleRad = 80.0 * kRadPerDeg;

/// The angle plus whole turns, in [-pi, pi].
[[nodiscard]] double wrap(double angle_rad) noexcept;
/// The same angle, next to `reference`.
[[nodiscard]] double wrap_next_to(double angle_rad, double reference_rad) noexcept;

/// North, up and east in the reference frame, one a column. North is the axis before `up`, east the
/// axis after it; a minus sign turns up and east round. `elevation_rad` (site.elevation_deg): how
/// far the base's north axis points up.
[[nodiscard]] Eigen::Matrix3d level_reference(const SignedAxis& up, double elevation_rad) noexcept;

/// Rate of the Earth, deg/h, reference frame.
[[nodiscard]] Eigen::Vector3d earth_rate_reference(const Eigen::Matrix3d& level,
                                                   double latitude_rad,
                                                   double azimuth_rad) noexcept;

/// All that follows from the gimbal angles (outer alpha about x, inner beta about y, azimuth gamma
/// about z).
struct Pose {
    double cos_beta = 1, sin_beta = 0, cos_gamma = 1, sin_gamma = 0;
    Eigen::Matrix3d c;  ///< C_r^p, reference (north, up, east for up = +y) to platform
    Eigen::Matrix3d m;  ///< d angles/dt = m w_p
    std::array<Eigen::Vector3d, 3> axis;  ///< gimbal axes e_alpha, e_beta, e_gamma in platform axes
    Eigen::Matrix3d level;                ///< north, up, east in platform axes, one a column
    Eigen::Vector3d up;                   ///< direction of specific force, platform axes
    Eigen::Vector3d earth_rate;           ///< deg/h, platform axes
};

/// Frames, site and encoders. Immutable after construction.
class Kinematics {
  public:
    explicit Kinematics(const Settings& settings);

    /// Gimbal angles, wrapped, of raw encoder angles: sign * (raw - zero), zero being the reading
    /// at angle zero.
    [[nodiscard]] Eigen::Vector3d gimbal_angles(
        const std::array<double, 3>& encoder_rad) const noexcept;
    [[nodiscard]] Pose pose(const Eigen::Vector3d& angles_rad) const noexcept;

    /// level_reference() of its settings.
    [[nodiscard]] const Eigen::Matrix3d& level() const noexcept { return level_; }
    [[nodiscard]] const Eigen::Vector3d& earth_rate_reference() const noexcept {
        return earth_rate_;
    }

  private:
    Eigen::Matrix3d level_;
    Eigen::Vector3d earth_rate_, encoder_sign_, encoder_zero_;
};

}  // namespace vibrig::estimator
