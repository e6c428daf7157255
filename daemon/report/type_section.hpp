#pragma once

#include "daemon/record/campaign_file.hpp"
#include "daemon/report/page.hpp"

namespace vibrig::report {

/// The coefficients without and with what the archive knew of the unit's type, where the campaign
/// was planned by it (campaign.prior).
void add_type(Page& page, const record::Campaign& campaign);

}  // namespace vibrig::report
