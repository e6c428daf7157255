#pragma once

#include <array>
#include <cstddef>
#include <limits>

#include "estimator/filter/coefficients.hpp"
#include "estimator/filter/vibration_moment.hpp"

namespace vibrig::estimator {
struct DwellRow;
}

namespace vibrig::record {

template <std::size_t N>
constexpr std::array<double, N> not_known() {
    std::array<double, N> values;
    values.fill(std::numeric_limits<double>::quiet_NaN());
    return values;
}

/// What a dwell says of the coefficients, all in numbers; nobody reads it back. NaN: left out.
struct DwellNumbers {
    double middle_s = not_known<1>()[0];
    std::array<double, 3> rate = not_known<3>();
    std::array<double, 9> rate_covariance = not_known<9>();  ///< 3 x 3
    std::array<double, estimator::kParameters> rate_regressors =
        not_known<estimator::kParameters>();  ///< 3 x 10
    std::array<double, 3> ramp = not_known<3>(), ramp_sigma = not_known<3>();
    estimator::LevelTensor gamma = not_known<6>();
    double sync_arcsec = not_known<1>()[0];
};
[[nodiscard]] DwellNumbers numbers_of(const estimator::DwellRow& row);

}  // namespace vibrig::record
