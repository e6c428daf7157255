#pragma once

#include "daemon/record/campaign_file.hpp"
#include "daemon/report/page.hpp"

namespace vibrig::report {

/// Adds, for a campaign at several frequencies: what the coefficients are over frequency, and what
/// is not known of that.
void add_spectrum(Page& page, const record::Campaign& campaign);

}  // namespace vibrig::report
