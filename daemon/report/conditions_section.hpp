#pragma once

#include "daemon/record/campaign_file.hpp"
#include "daemon/report/page.hpp"

namespace vibrig::report {

/// Temperatures, and the shaker's command beside what became of it.
void add_conditions(Page& page, const record::Campaign& campaign);

/// Zeros of the accelerometers taken in place, where they changed.
void add_zeros(Page& page, const record::Campaign& campaign);

}  // namespace vibrig::report
