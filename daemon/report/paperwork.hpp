#pragma once

#include <cstdint>
#include <string>

#include "daemon/record/campaign_file.hpp"
#include "daemon/record/settings.hpp"

namespace vibrig::report {

/// What the campaign's configuration states of unit and instruments.
[[nodiscard]] record::Paperwork paperwork_of(const record::Campaign& campaign);
/// "not stated" for nothing.
[[nodiscard]] std::string or_dash(const std::string& text);
/// Type and serial number.
[[nodiscard]] std::string unit_text(const record::Paperwork& unit);
/// "2026-03-01 08:00:00 UTC"
[[nodiscard]] std::string utc_text(std::int64_t utc_ns);

}  // namespace vibrig::report
