#include "estimator/filter/parameters.hpp"

namespace vibrig::estimator {

const std::array<const char*, kParameters>& parameter_names() noexcept {
    static constexpr std::array<const char*, kParameters> kNames{
        "D_Fx", "D_Ix", "D_Ox", "D_Sx", "D_IIx", "D_OOx", "D_SSx", "D_IOx", "D_ISx", "D_OSx",
        "D_Fy", "D_Iy", "D_Oy", "D_Sy", "D_IIy", "D_OOy", "D_SSy", "D_IOy", "D_ISy", "D_OSy",
        "D_Fz", "D_Iz", "D_Oz", "D_Sz", "D_IIz", "D_OOz", "D_SSz", "D_IOz", "D_ISz", "D_OSz"};
    return kNames;
}

const char* parameter_unit(std::size_t index) noexcept {
    const std::size_t group = kPublicGroup[index % kGroups];
    return group == kDt ? "deg/h" : group <= kDo ? "deg/h/g" : "deg/h/g^2";
}

ParameterArray prior_sigma(const Settings& settings) noexcept {
    ParameterArray sigma{};
    for (std::size_t group = 0; group < kGroups; ++group) {
        const double s = group == kDt   ? settings.prior_bias
                         : group <= kDo ? settings.prior_linear
                                        : settings.prior_quadratic;
        for (std::size_t gyro = 0; gyro < kGyros; ++gyro) sigma[internal_index(group, gyro)] = s;
    }
    return sigma;
}

}  // namespace vibrig::estimator
