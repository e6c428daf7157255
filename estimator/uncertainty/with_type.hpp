#pragma once

#include <array>

#include "estimator/uncertainty/assessment.hpp"
#include "estimator/uncertainty/population.hpp"

namespace vibrig::estimator::uncertainty {

/// A result together with its unit's type: reported beside it, never in its place.
struct WithType {
    bool determined = true;  ///< false: not all 30 coefficients are, and there is nothing to join
    Distance distance;
    std::array<double, kParameters> value{}, u{};  ///< u: combined; order of parameter_names()
};
[[nodiscard]] WithType with_type(const Population& type, const Assessment& assessed);

}  // namespace vibrig::estimator::uncertainty
