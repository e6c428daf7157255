#pragma once

#include "daemon/report/page.hpp"
#include "estimator/uncertainty/assessment.hpp"

namespace vibrig::report {

/// The verdict first, then what each coefficient is worth and why, then the dwells' residuals.
void add_uncertainty(Page& page, const estimator::uncertainty::Assessment& assessed,
                     double coverage);

}  // namespace vibrig::report
