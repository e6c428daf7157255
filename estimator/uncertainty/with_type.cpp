#include "estimator/uncertainty/with_type.hpp"

#include <algorithm>
#include <cmath>

namespace vibrig::estimator::uncertainty {

WithType with_type(const Population& type, const Assessment& assessed) {
    constexpr auto kSize = static_cast<Eigen::Index>(kParameters);
    WithType out;
    Found found{Eigen::VectorXd(kSize), assessed.covariance_a};
    for (Eigen::Index i = 0; i < kSize; ++i)
        found.value(i) = assessed.coefficients[static_cast<std::size_t>(i)].value;
    out.determined = assessed.done && found.covariance.rows() == kSize && found.value.allFinite() &&
                     found.covariance.allFinite();
    if (!out.determined) return out;
    out.distance = distance(type, found);
    const Found joined = with_type(type, found);
    for (Eigen::Index i = 0; i < kSize; ++i) {
        const auto k = static_cast<std::size_t>(i);
        out.value[k] = joined.value(i);
        // What is wrong in the same way in every campaign the other units do not tell.
        const double systematic =
            std::max(0.0, assessed.covariance_combined(i, i) - assessed.covariance_a(i, i));
        out.u[k] = std::sqrt(joined.covariance(i, i) + systematic);
    }
    return out;
}

}  // namespace vibrig::estimator::uncertainty
