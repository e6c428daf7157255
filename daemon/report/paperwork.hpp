#pragma once

#include <cstdint>
#include <string>

#include "daemon/configuration/configuration.hpp"
#include "daemon/configuration/record_settings.hpp"
#include "daemon/record/campaign_file.hpp"

namespace vibrig::report {

/// The model of the 30 coefficients with its symbols, for people.
inline constexpr const char* kDriftModel =
    "D = D_F + D_I aI + D_O aO + D_S aS + D_II aI^2 + D_OO aO^2 + D_SS aS^2 + D_IO aI aO + D_IS aI "
    "aS + D_OS aO aS; a: specific force along input, output and spin axis of the gyro, g; under "
    "vibration the squares are means over it";
/// What of the campaign's configuration its identification depends on.
[[nodiscard]] configuration::Configuration configuration_of(const record::Campaign& campaign);
/// What the campaign's configuration states of unit and instruments.
[[nodiscard]] configuration::Paperwork paperwork_of(const record::Campaign& campaign);
/// Coverage probability of U, 0 to 1.
[[nodiscard]] double coverage_of(const record::Campaign& campaign);
/// "not stated" for nothing.
[[nodiscard]] std::string or_dash(const std::string& text);
/// Type and serial number.
[[nodiscard]] std::string unit_text(const configuration::Paperwork& unit);
/// "2026-03-01 08:00:00 UTC"
[[nodiscard]] std::string utc_text(std::int64_t utc_ns);

}  // namespace vibrig::report
