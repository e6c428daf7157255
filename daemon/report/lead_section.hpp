#pragma once

#include "daemon/record/campaign_file.hpp"
#include "daemon/record/replay.hpp"
#include "daemon/report/page.hpp"

namespace vibrig::report {

/// What the coefficients mean, what it was like meanwhile, and what was left out and why.
void add_lead(Page& page, const record::Campaign& campaign, const record::ReplayResult& replayed);

}  // namespace vibrig::report
