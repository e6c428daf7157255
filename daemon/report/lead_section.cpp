#include "daemon/report/sections.hpp"

#include <spdlog/fmt/fmt.h>

#include <cmath>

#include "daemon/report/paperwork.hpp"

namespace vibrig::report {

namespace {

std::string conditions_text(const record::Campaign& campaign) {
    double least = std::nan(""), greatest = least, command = least;
    for (const auto& row : campaign.conditions) {
        least = std::fmin(least, row.temperature_c);
        greatest = std::fmax(greatest, row.temperature_c);
        command = std::fmax(command, row.command_g);
    }
    if (std::isnan(least)) return "Conditions: the platform reported no temperature.";
    return fmt::format(
        "Conditions: platform at {:.2f} to {:.2f} degC{}.", least, greatest,
        command > 0 ? fmt::format(", table shaken with up to {:.2f} g, peak", command) : "");
}

}  // namespace

void add_lead(Page& page, const record::Campaign& campaign, const record::ReplayResult& replayed) {
    page.section("model", "Model, conditions, what was left out");
    page.paragraph(std::string("Drift of a gyro, deg/h: ") + kDriftModel + ".");
    page.paragraph(conditions_text(campaign));
    std::size_t offered = 0, rejected = 0;
    Rows rows{{"run, position", "samples rejected", "why"}};
    for (const auto& dwell : replayed.dwells) {
        const auto& s = dwell.summary;
        offered += s.samples;
        rejected += s.rejected;
        if (!s.flagged && !s.left_out) continue;
        rows.push_back({fmt::format("{}, {}", s.run, s.position), fmt::to_string(s.rejected),
                        std::string(s.left_out ? "!left out: " : "flagged: ") + dwell.reason});
    }
    page.paragraph(fmt::format(
        "Rejected: {} of {} samples, by the innovation gate; {} of {} "
        "dwells are flagged or left out{}",
        rejected, offered, rows.size() - 1, replayed.dwells.size(), rows.size() > 1 ? ":" : "."));
    if (rows.size() > 1) page.table(rows, "words");
}

}  // namespace vibrig::report
