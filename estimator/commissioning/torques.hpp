#pragma once

#include <string>
#include <vector>

#include "estimator/commissioning/earth.hpp"

namespace vibrig::estimator::commissioning {

/// A free drift while one torquer was commanded, or none.
struct Torqued {
    Vec3 command_deg_h{};  ///< by the commands' names x, y, z
    FreeDrift drift;
};

struct TorqueSettings {
    double rate_sigma = 0.08;           ///< of one rate, deg/h
    double factor = 2;                  ///< of rate over command: beyond it is refused
    double warn_scale = 0.05;           ///< off 1
    double warn_turn_arcmin = 10;       ///< about the azimuth axis, of gyros against accelerometers
    double turn_deg = 5, skew_deg = 1;  ///< beyond these no description fits
};

/// What the commands do, platform axes of `description`.
struct TorqueFinding {
    Verdict verdict = Verdict::undecided;
    std::string why;                                     ///< refused
    Eigen::Matrix3d response = Eigen::Matrix3d::Zero();  ///< rate over command, a column each
    double sigma = 0;                                    ///< of each element
    std::array<int, 3> axis{-1, -1, -1};  ///< that a command turns; decided: all three
    std::array<int, 3> sign{1, 1, 1};     ///< of the rate over the command
    Vec3 scale{};                         ///< its size
    double turn_arcmin = 0;               ///< of the torquers' axes about platform z
    std::vector<std::string> warnings;    ///< accepted, but odd
    /// As given, its platform axes turned about z to the torquers'.
    Description description;
    /// Each command turns the axis of its own name.
    [[nodiscard]] bool named() const { return axis == std::array<int, 3>{0, 1, 2}; }
};

/// Rates under a known torque of one axis at a time, both ways, against the same position without:
/// sign, scale and axis of each torquer, and with them which platform axis gyro j turns, since gyro
/// and torquer j act along one axis (docs/commissioning.md, "Torquers"). Throws
/// std::invalid_argument where a way of an axis or the drift without is missing, a command has more
/// than one axis, or something is not finite.
[[nodiscard]] TorqueFinding find_by_torque(const Description& description, const EarthRate& rate,
                                           const std::vector<Torqued>& drifts,
                                           const TorqueSettings& settings = {});

/// The same rig with its platform axes named as the torquers are: of the namings that gravity and
/// the Earth's rate leave, the one whose accelerometers keep most of their names. Not named():
/// none does it.
[[nodiscard]] TorqueFinding named_by_torquers(const Description& description, const EarthRate& rate,
                                              const std::vector<Torqued>& drifts,
                                              const TorqueSettings& settings = {});

}  // namespace vibrig::estimator::commissioning
