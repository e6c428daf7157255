#pragma once

namespace vibrig::estimator {

inline constexpr double kPi = 3.14159265358979323846;
inline constexpr double kRadPerDeg = kPi / 180;
inline constexpr double kDegPerRad = 180 / kPi;
inline constexpr double kArcsecPerRad = 206264.80625;

}  // namespace vibrig::estimator
