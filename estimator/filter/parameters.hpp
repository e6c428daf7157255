#pragma once

#include <array>
#include <cstddef>

#include "estimator/filter/settings.hpp"

namespace vibrig::estimator {

/// The only mapping between the filter's order and that of parameter_names(), where gyro x comes
/// first as F I O S II OO SS IO IS OS.
inline constexpr std::array<std::size_t, kGroups> kPublicGroup = [] {
    std::array<std::size_t, kGroups> group{};
    for (std::size_t g = 0; g < kGroups; ++g) group[kCoefficientTable[g].place] = g;
    return group;
}();

[[nodiscard]] constexpr std::size_t internal_index(std::size_t group, std::size_t gyro) noexcept {
    return kGyros * group + gyro;
}

/// Index in the filter of the parameter at `public_index` of parameter_names().
[[nodiscard]] constexpr std::size_t internal_of(std::size_t public_index) noexcept {
    return internal_index(kPublicGroup[public_index % kGroups], public_index / kGroups);
}

using ParameterArray = std::array<double, kParameters>;

/// D_Fx D_Ix D_Ox D_Sx D_IIx D_OOx D_SSx D_IOx D_ISx D_OSx, then y, z (IEEE Std 517 usage).
[[nodiscard]] const std::array<const char*, kParameters>& parameter_names() noexcept;
/// Of the specific force: 0 constant, 1 linear, 2 quadratic.
[[nodiscard]] constexpr std::size_t order_of(std::size_t public_index) noexcept {
    return static_cast<std::size_t>(kCoefficientTable[kPublicGroup[public_index % kGroups]].order);
}
/// Those that depend on the vibration that they were determined under.
[[nodiscard]] constexpr bool is_quadratic(std::size_t public_index) noexcept {
    return order_of(public_index) == 2;
}
/// "deg/h", "deg/h/g" or "deg/h/g^2".
[[nodiscard]] const char* parameter_unit(std::size_t index) noexcept;

/// Prior standard deviations, filter order.
[[nodiscard]] ParameterArray prior_sigma(const Settings& settings) noexcept;

}  // namespace vibrig::estimator
