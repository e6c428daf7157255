#pragma once

#include <array>

#include "estimator/filter/settings.hpp"

namespace vibrig::estimator {

/// Gimbal angles of encoder angles, and back, deg, without wrapping.
[[nodiscard]] std::array<double, 3> gimbal_deg(const Settings& settings,
                                               const std::array<double, 3>& encoder_deg) noexcept;
[[nodiscard]] std::array<double, 3> encoder_deg(const Settings& settings,
                                                const std::array<double, 3>& gimbal_deg) noexcept;

/// Encoder angles within half a turn with the azimuth axis upright, platform z up or down, and this
/// turn of the azimuth gimbal, deg. Throws SettingsError where the gimbals cannot do that.
[[nodiscard]] std::array<double, 3> azimuth_upright_deg(const Settings& settings,
                                                        double azimuth_deg, bool down);
/// Encoder angles with the inner gimbal's axis, platform y, vertical, up or down, and this turn of
/// the inner gimbal. A base that leans along the north axis leaves it that far off where `up` is y.
/// Throws SettingsError as above.
[[nodiscard]] std::array<double, 3> inner_upright_deg(const Settings& settings, double inner_deg,
                                                      bool down);

}  // namespace vibrig::estimator
