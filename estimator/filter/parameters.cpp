#include "estimator/filter/parameters.hpp"

#include <string>

namespace vibrig::estimator {
namespace {

std::array<std::string, kParameters> made_names() {
    std::array<std::string, kParameters> names;
    for (std::size_t i = 0; i < kParameters; ++i)
        names[i] = std::string("D_") + kCoefficientTable[kPublicGroup[i % kGroups]].letters +
                   "xyz"[i / kGroups];
    return names;
}

}  // namespace

const std::array<const char*, kParameters>& parameter_names() noexcept {
    static const auto kText = made_names();
    static const auto kNames = [] {
        std::array<const char*, kParameters> names{};
        for (std::size_t i = 0; i < kParameters; ++i) names[i] = kText[i].c_str();
        return names;
    }();
    return kNames;
}

const char* parameter_unit(std::size_t index) noexcept {
    constexpr std::array<const char*, 3> kUnits{"deg/h", "deg/h/g", "deg/h/g^2"};
    return kUnits[order_of(index)];
}

ParameterArray prior_sigma(const Settings& settings) noexcept {
    const std::array by_order{settings.prior_bias, settings.prior_linear, settings.prior_quadratic};
    ParameterArray sigma{};
    for (std::size_t group = 0; group < kGroups; ++group) {
        const double s = by_order[static_cast<std::size_t>(kCoefficientTable[group].order)];
        for (std::size_t gyro = 0; gyro < kGyros; ++gyro) sigma[internal_index(group, gyro)] = s;
    }
    return sigma;
}

}  // namespace vibrig::estimator
