#pragma once

#include "daemon/noise/found.hpp"
#include "estimator/identification/result.hpp"
#include "estimator/uncertainty/assessment.hpp"

namespace vibrig::dwells {

/// What was shown before a campaign was identified anew.
struct Live {
    noise::Found found;
    estimator::Result result;
    estimator::uncertainty::Assessment assessed;
};

}  // namespace vibrig::dwells
