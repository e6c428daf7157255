#pragma once

#include <string>

#include "daemon/record/campaign_file.hpp"

namespace vibrig::tool {

inline constexpr const char* kCampaignHelp =
    "its folder or HDF5 file, or its name in the index (recordings.sqlite3 here, in "
    "$VIBRIG_RECORDINGS or in /var/lib/vibrig)";

/// The path that CAMPAIGN means; throws std::runtime_error.
[[nodiscard]] std::string named_campaign(const std::string& argument);
/// Reads all its parts. What the index says of its files goes to standard error; throws, too, if
/// one is missing.
[[nodiscard]] record::Campaign read_named_campaign(const std::string& argument);

/// Says on standard error which segments of the raw log are not in `folder`; true: none.
[[nodiscard]] bool tell_missing_raw(const std::string& folder);
/// Likewise which are there and not among `logs`.
[[nodiscard]] bool tell_left_out(const std::string& folder, const std::vector<std::string>& logs);

}  // namespace vibrig::tool
