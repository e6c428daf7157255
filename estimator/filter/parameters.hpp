#pragma once

#include <array>
#include <cstddef>

#include "estimator/filter/settings.hpp"

namespace vibrig::estimator {

inline constexpr std::size_t kGroups = 10;
inline constexpr std::size_t kGyros = 3;

/// Group order inside the filter (Tang et al. 2009): input, *spin*, output; the filter's index is 3
/// * group + gyro.
enum Group : std::size_t { kDt, kDi, kDs, kDo, kDii, kDss, kDoo, kDis, kDio, kDos };

/// The only mapping between the filter's order and that of parameter_names(), where gyro x comes
/// first as F I O S II OO SS IO IS OS.
inline constexpr std::array<std::size_t, kGroups> kPublicGroup{kDt,  kDi,  kDo,  kDs,  kDii,
                                                               kDoo, kDss, kDio, kDis, kDos};

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
/// "deg/h", "deg/h/g" or "deg/h/g^2".
[[nodiscard]] const char* parameter_unit(std::size_t index) noexcept;

/// Prior standard deviations, filter order.
[[nodiscard]] ParameterArray prior_sigma(const Settings& settings) noexcept;

}  // namespace vibrig::estimator
