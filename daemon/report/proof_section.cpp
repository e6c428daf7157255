#include "daemon/report/sections.hpp"

#include <spdlog/fmt/fmt.h>

#include <nlohmann/json.hpp>

#include "daemon/plot/chart.hpp"
#include "daemon/report/paperwork.hpp"

namespace vibrig::report {

using nlohmann::json;

namespace {

constexpr double kDay_ns = 86'400e9;

std::string limit_text(const json& row) {
    const double low = row.at("low"), high = row.at("high");
    return low == high ? fmt::format("{:g}", low) : fmt::format("{:.4g} to {:.4g}", low, high);
}

void add_rows(Page& page, const json& newest) {
    Rows rows{{"Proved", "Value", "Unit", "Expected"}};
    for (const json& row : newest.at("rows")) {
        const bool passed = row.at("passed");
        rows.push_back({row.at("name"),
                        (passed ? "" : "!") + fmt::format("{:.4g}", row.at("value").get<double>()),
                        row.at("unit"), limit_text(row)});
    }
    page.table(rows, "words");
    const json& pads = newest.at("pads");
    page.paragraph(fmt::format("The platform rings down on its pads at {:.2f} Hz, damping {:.3f}.",
                               pads.at("frequency_hz").get<double>(),
                               pads.at("damping").get<double>()));
}

/// Stop times over the days: a contactor that wears shows.
void add_trend(Page& page, const json& proof) {
    const json& history = proof.at("history");
    tool::plot::Chart chart{.title = "Stop times of the proofs",
                            .x = tool::plot::Axis("days before the newest proof", false),
                            .y = tool::plot::Axis("s", false)};
    const double newest = proof.at("newest").at("utc_ns");
    for (const char* name : {"stop, table", "stop, platform", "watchdog, rest"}) {
        tool::plot::Curve curve{.name = name, .look = tool::plot::Look::dots};
        for (const json& past : history) {
            if (!past.at("times_s").contains(name)) continue;
            curve.add((past.at("utc_ns").get<double>() - newest) / kDay_ns,
                      past.at("times_s").at(name));
        }
        if (curve.x.size() > 1) chart.curves.push_back(std::move(curve));
    }
    const std::string trend = proof.at("trend");
    page.paragraph(!trend.empty()         ? "Warning: " + trend + "."
                   : chart.curves.empty() ? "This is the only proof so far: there is no trend."
                                          : fmt::format("No stop takes clearly longer than in the "
                                                        "{} proofs before.",
                                                        history.size() - 1));
    if (!chart.curves.empty())
        page.figure(chart.svg(), "Each dot is one proof; a contactor that wears rises.");
}

}  // namespace

void add_proof(Page& page, const record::Campaign& campaign) {
    page.section("safe-state", "Proof of the safe state");
    if (campaign.head.proof.empty()) return page.paragraph("None was made before this campaign.");
    try {
        const json proof = json::parse(campaign.head.proof);
        const json& newest = proof.at("newest");
        const bool passed = newest.at("passed");
        page.table({{"", ""},
                    {"By", newest.at("by")},
                    {"When", utc_text(newest.at("utc_ns"))},
                    {"At", fmt::format("{:g} g at the table", newest.at("table_g").get<double>())},
                    {"Verdict", passed ? std::string("passed")
                                       : "!not passed: " + newest.at("message").get<std::string>()},
                    {"Emergency stop", newest.at("emergency_stop") ? "pressed, and obeyed"
                                                                   : "not part of this proof"},
                    {"Keys it covers", "SHA-256 " + newest.at("keys_sha256").get<std::string>()}},
                   "words");
        add_rows(page, newest);
        add_trend(page, proof);
    } catch (const json::exception& error) {
        page.paragraph(std::string("What is recorded of it cannot be read: ") + error.what());
    }
}

}  // namespace vibrig::report
