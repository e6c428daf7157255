#pragma once

#include "daemon/record/campaign_file.hpp"
#include "daemon/report/page.hpp"

namespace vibrig::report {

/// What had been proved of stopping when the campaign began: who, when, all times and ratios, hash
/// of the keys it covers, and how the stop times of earlier proofs compare.
void add_proof(Page& page, const record::Campaign& campaign);

}  // namespace vibrig::report
