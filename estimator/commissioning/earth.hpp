#pragma once

#include <optional>
#include <string>
#include <vector>

#include "estimator/commissioning/gravity.hpp"

namespace vibrig::estimator::commissioning {

/// A stop without torquing: how fast the readings run.
struct FreeDrift {
    Vec3 reading{};  ///< as of a Stop
    Vec3 slope{};    ///< of the readings, their unit per hour
};

struct EarthSettings {
    double bias_sigma = 6;     ///< of the fixed drift, deg/h
    double linear_sigma = 2;   ///< deg/h/g
    double rate_sigma = 0.08;  ///< of one rate, deg/h: noise and what the squares make
};

/// The Earth's rate in the axes of a description: north, east, up of a level rig, deg/h.
struct EarthRate {
    Eigen::Vector3d neu = Eigen::Vector3d::Zero();  ///< north, east, up
    Eigen::Vector3d sigma = Eigen::Vector3d::Zero();
    /// Azimuth of the rig's north axis, from true north towards east.
    [[nodiscard]] double azimuth_deg() const;
    /// Without its sign, from the horizontal part; 0 where that is more than the Earth's.
    [[nodiscard]] double latitude_deg() const;
    [[nodiscard]] double latitude_sigma_deg() const;
};

/// Least squares over Earth rate, fixed and linear drift; of a wrong parity north, -east, -up.
/// Throws std::invalid_argument for fewer than 3 drifts or what is not finite.
[[nodiscard]] EarthRate earth_rate(const Description& description,
                                   const std::vector<FreeDrift>& drifts,
                                   const EarthSettings& settings = {});

/// The platform's rate in inertial space during a drift, platform axes, deg/h: M^-1 times the rates
/// of the angles, plus the Earth's.
[[nodiscard]] Eigen::Vector3d platform_rate(const Description& description, const FreeDrift& drift,
                                            const EarthRate& rate);

/// What people say, each if it is known.
struct Statements {
    std::optional<double> latitude_deg{};
    std::optional<double> compass_deg{};  ///< of the outer axis' line, either end
    /// The marks of the accelerometers x, y, z as the bus names them form a right-handed triad.
    std::optional<bool> right_handed{};
    /// The azimuth gimbal turned anticlockwise, seen from its upper end, at this reading of all
    /// channels: its own reading grew.
    struct Sense {
        Vec3 reading{};
        bool grew = false;
    };
    std::optional<Sense> sense{};
};

struct Witness {
    std::string name;    ///< "latitude", "compass", "drawing", "sense"
    double ln_odds = 0;  ///< for the parity of the description
};

struct EarthFinding {
    Verdict verdict = Verdict::undecided;
    std::string why;
    Description description;  ///< decided: with the right parity, of that one preferred_of()
    EarthRate rate;           ///< in its axes
    std::vector<Witness> witnesses;
    std::vector<std::string> outvoted;  ///< statements that are wrong
};

/// Decides the parity by what people say against the Earth's rate, and holds both against one
/// another: no witness alone suffices (docs/commissioning.md, "Earth rate and parity"). Without
/// drifts drawing and sense must agree. The description is one that preferred_of() has given.
[[nodiscard]] EarthFinding find_by_earth(const Description& description,
                                         const std::vector<FreeDrift>& drifts,
                                         const Statements& statements,
                                         const EarthSettings& settings = {});

/// "60 times too large: time in minutes?"; empty: the horizontal rate fits the latitude.
[[nodiscard]] std::string time_unit_doubt(double horizontal, double latitude_deg);

}  // namespace vibrig::estimator::commissioning
