#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

// What is known of a rig whose configuration is not: readings and forces at rest, rates of free
// drift. Theory, conventions and limits: docs/commissioning.md. Frames and signs are those of
// estimator/filter/kinematics.hpp with platform.up "+y".

namespace vibrig::estimator::commissioning {

using Vec3 = std::array<double, 3>;

/// Means over some seconds of rest, channels in the order of the bus.
struct Stop {
    Vec3 reading{};  ///< of the three angle channels, in a unit that is not known
    Vec3 force{};    ///< of the three accelerometers, g
    int swept = -1;  ///< channel that alone has moved since the other stops of its sweep; -1: none
};

/// What one count of an angle channel may be.
struct AngleUnit {
    const char* name;
    double degrees;  ///< of the gimbal, per unit of the reading
};
/// deg, turn, rad, arcmin, gon, 2^8 ... 2^24 counts a turn, the double and the half of a degree.
[[nodiscard]] const std::vector<AngleUnit>& angle_units();

/// One way to describe a rig completely; see configuration_of().
struct Description {
    std::array<int, 3> channel{0, 1, 2};  ///< of outer, inner and azimuth gimbal
    std::array<int, 3> unit{};            ///< of these, indices of angle_units()
    std::array<int, 3> sign{1, 1, 1};     ///< angle = sign * (degrees of the reading - zero)
    Vec3 zero_deg{};
    double elevation_deg = 0;       ///< of the outer axis' end that the angles count about
    Eigen::Matrix3d accelerometers  ///< raw = accelerometers * platform force + zero_g
        = Eigen::Matrix3d::Identity();
    Eigen::Vector3d zero_g = Eigen::Vector3d::Zero();

    /// Outer, inner, azimuth in rad of the channels' readings.
    [[nodiscard]] Eigen::Vector3d angles(const Vec3& reading) const;
    /// The vertical in platform axes, and what the accelerometers show there, g.
    [[nodiscard]] Eigen::Vector3d up(const Vec3& reading) const;
    [[nodiscard]] Eigen::Vector3d force(const Vec3& reading) const;
    /// The signed permutation that is nearest to `accelerometers`.
    [[nodiscard]] Eigen::Matrix3d wiring() const;
};

/// The vertical in platform axes at gimbal angles in rad, on a base whose outer axis points up by
/// `elevation` (rad).
[[nodiscard]] Eigen::Vector3d up_at(const Eigen::Vector3d& angles, double elevation);

/// The 48 signed permutations.
[[nodiscard]] const std::vector<Eigen::Matrix3d>& signed_permutations();

/// The 32 descriptions that gravity cannot tell apart, the one given first: names of the platform's
/// axes (8), end of the outer axis (2), parity (2). The second half has the other parity.
[[nodiscard]] std::vector<Description> family_of(const Description& one);

/// The preferred one of a family, with the parity of `one`: counted about the end with
/// encoder_sign[0] = 1, and the accelerometers named as the bus names them as far as that goes.
[[nodiscard]] Description preferred_of(const Description& one);

}  // namespace vibrig::estimator::commissioning
