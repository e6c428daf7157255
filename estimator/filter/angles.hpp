#pragma once

namespace vibrig::estimator {

inline constexpr double kPi = 3.14159265358979323846;
inline constexpr double kRadPerDeg = kPi / 180;
inline constexpr double kDegPerRad = 180 / kPi;
inline constexpr double kRadPerArcmin = kRadPerDeg / 60;
inline constexpr double kRadPerArcsec = kRadPerDeg / 3600;
/// Factors of the drift model's equations, to the digits that they are published with.
inline constexpr double kArcsecPerRad = 206264.80625;
inline constexpr double kDegPerHour = kRadPerDeg / 3600;    ///< rad/s
inline constexpr double kDegPerRootHour = kRadPerDeg / 60;  ///< rad/sqrt(s)

}  // namespace vibrig::estimator
