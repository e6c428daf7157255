#pragma once

#include <string>

#include "daemon/record/campaign_file.hpp"

namespace vibrig::tool {

/// The campaign's dwells as `vibrig identify` reads them from CSV: samples of good quality, deg and
/// g, zeros that were taken in place subtracted; with what shook where the campaign's orders say it
/// (frequency_hz, profile, level_db, role). Says on standard error what is there and what is left
/// out. Throws std::runtime_error where there is no good sample, proto::RecordingError.
void export_csv(const record::Campaign& campaign, const std::string& path);

}  // namespace vibrig::tool
