#include "daemon/report/paperwork.hpp"

#include <spdlog/fmt/chrono.h>
#include <spdlog/fmt/fmt.h>

namespace vibrig::report {

configuration::Configuration configuration_of(const record::Campaign& campaign) {
    return configuration::parse(record::identification_sections(campaign.head.configuration),
                                "configuration in " + campaign.path, false)
        .configuration;
}

double coverage_of(const record::Campaign& campaign) {
    return configuration_of(campaign).estimator.uncertainty.coverage;
}

configuration::Paperwork paperwork_of(const record::Campaign& campaign) {
    return configuration_of(campaign).paperwork;
}

std::string or_dash(const std::string& text) { return text.empty() ? "not stated" : text; }

std::string unit_text(const configuration::Paperwork& unit) {
    return or_dash(unit.unit_type) + ", serial number " + or_dash(unit.unit_serial);
}

std::string utc_text(std::int64_t utc_ns) {
    return fmt::format("{:%Y-%m-%d %H:%M:%S} UTC",
                       fmt::gmtime(static_cast<std::time_t>(utc_ns / drivers::kSecond)));
}

}  // namespace vibrig::report
