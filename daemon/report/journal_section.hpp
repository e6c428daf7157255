#pragma once

#include <string>

#include "daemon/record/campaign_file.hpp"
#include "daemon/report/page.hpp"

namespace vibrig::report {

/// Whether the journal at `path` (empty: the one beside the campaign's folder) is what was written
/// into it and goes through the recording's head; begins with '!' if not. In words.
[[nodiscard]] std::string journal_verdict(const record::Campaign& campaign,
                                          const std::string& path);

/// The signed head that the recording carries, and that verdict.
void add_journal(Page& page, const record::Campaign& campaign, const std::string& verdict);

}  // namespace vibrig::report
