#include "daemon/record/dwell_numbers.hpp"

#include <cmath>

#include "estimator/filter/parameters.hpp"
#include "estimator/identification/dwell_row.hpp"

namespace vibrig::record {

DwellNumbers numbers_of(const estimator::DwellRow& row) {
    constexpr std::size_t kTerms = estimator::kParameters / 3;
    DwellNumbers numbers;
    numbers.middle_s = row.middle_s;
    numbers.sync_arcsec = row.sync_arcsec;
    numbers.gamma = row.vibration.gamma;
    for (std::size_t j = 0; j < 3; ++j) {
        const auto g = static_cast<Eigen::Index>(j);
        numbers.rate[j] = row.rate[g];
        numbers.ramp[j] = row.ramp[g];
        numbers.ramp_sigma[j] = std::sqrt(row.ramp_variance(g, g));
        for (std::size_t k = 0; k < 3; ++k)
            numbers.rate_covariance[3 * j + k] = row.variance(g, static_cast<Eigen::Index>(k));
        for (std::size_t t = 0; t < kTerms; ++t)
            numbers.rate_regressors[kTerms * j + t] = row.regressors(
                g, static_cast<Eigen::Index>(estimator::internal_of(kTerms * j + t) / 3));
    }
    return numbers;
}

}  // namespace vibrig::record
