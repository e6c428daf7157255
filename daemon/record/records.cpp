#include "daemon/record/records.hpp"

#include <algorithm>
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
    numbers.rate = row.rate;
    numbers.ramp = row.ramp;
    for (std::size_t j = 0; j < 3; ++j) {
        numbers.ramp_sigma[j] = std::sqrt(row.ramp_variance[j][j]);
        std::ranges::copy(row.variance[j], &numbers.rate_covariance[3 * j]);
        for (std::size_t t = 0; t < kTerms; ++t)
            numbers.rate_regressors[kTerms * j + t] =
                row.regressors[j][estimator::internal_of(kTerms * j + t) / 3];
    }
    return numbers;
}

DwellNumbers numbers_after(const estimator::Identification& identification,
                           const estimator::DwellSummary& summary) {
    const auto& rows = identification.rows();
    if (summary.left_out || rows.empty() || rows.back().run != summary.run ||
        rows.back().position != summary.position)
        return {};
    return numbers_of(rows.back());
}

}  // namespace vibrig::record
