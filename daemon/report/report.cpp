#include "daemon/report/report.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "daemon/plot/chart.hpp"
#include "daemon/record/digest.hpp"
#include "daemon/report/journal_section.hpp"
#include "daemon/report/page.hpp"
#include "daemon/report/paperwork.hpp"
#include "daemon/report/result_charts.hpp"
#include "daemon/report/sections.hpp"
#include "daemon/version.hpp"
#include "estimator/filter/angles.hpp"
#include "estimator/filter/instruction_set.hpp"

namespace vibrig::report {

using estimator::kParameters;
using record::Campaign;
using tool::plot::Axis;
using tool::plot::Chart;
using tool::plot::Curve;
using tool::plot::Look;

namespace {

constexpr std::size_t kMostShown = 600;

std::string num(double value, int digits) {
    return std::isfinite(value) ? fmt::format("{:.{}f}", value, digits) : "-";
}

double correlation(const Coefficients& c, std::size_t i, std::size_t j) {
    return c.covariance[i * kParameters + j] /
           std::sqrt(c.covariance[i * kParameters + i] * c.covariance[j * kParameters + j]);
}

std::string position_text(const Campaign& campaign, const record::RecordedDwell& dwell) {
    if (dwell.count == 0) return "-";
    const auto& angle = campaign.samples[dwell.first].angle;
    std::string text;
    for (const double a : angle)
        text += (text.empty() ? "" : ", ") +
                fmt::format("{:.1f}", std::remainder(a * estimator::kDegPerRad, 360.0) + 0.0);
    return text;
}

void add_head(Page& page, const Campaign& campaign, const Analysis& a) {
    const auto& head = campaign.head;
    const auto observable =
        static_cast<std::size_t>(std::ranges::count(a.coefficients.observable, true));
    page.paragraph(fmt::format(
        "Gyro error coefficients of an inertial platform, identified under linear vibration (Tang "
        "et al. 2009). Campaign {} of {}, {}; {} dwells, {} samples; {} of 30 coefficients are "
        "determined by the data.",
        head.name, utc_text(head.utc_ns), campaign.state, a.replayed.dwells.size(),
        campaign.samples.size(), observable));
    if (!a.anew_with.empty())
        page.table({{"settings"},
                    {"!identified anew with " + a.anew_with +
                     ", not as recorded; what was recorded beside it (over frequency, the unit's "
                     "type, earlier campaigns) is of the recorded settings"}},
                   "words");
}

void add_campaign(Page& page, const Campaign& campaign, const Analysis& a) {
    const auto& head = campaign.head;
    page.section("campaign", "Campaign");
    const auto unit = paperwork_of(campaign);
    Rows rows{{"", ""},
              {"Unit under test", unit_text(unit)},
              {"Operator", or_dash(head.started_by)},
              {"Started", utc_text(head.utc_ns)},
              {"Ended", campaign.ended_utc_ns > 0 ? utc_text(campaign.ended_utc_ns) : "not closed"},
              {"State", campaign.state + (campaign.reason.empty() ? "" : ": " + campaign.reason)},
              {"Recorded by",
               "vibrigd " + head.version + ", " + head.compiler + ", " + head.instruction_set},
              {"Report by", std::string("vibrig ") + kVersion + ", " +
                                std::string(estimator::compiler()) + ", " +
                                std::string(estimator::instruction_set())},
              {"Replay",
               !a.anew_with.empty() ? "not compared: identified anew with other settings"
               : !a.not_as_recorded.empty()
                   ? "!the recording's result is not that of its dwells: " + a.not_as_recorded
               : a.replayed.compared == 0 ? "no dwell to compare"
               : a.replayed.as_recorded()
                   ? fmt::format("estimates after each of {} dwells as recorded, to the last bit",
                                 a.replayed.compared)
                   : "!differs from the recording: " + a.replayed.first_difference},
              {"Configuration", "SHA-256 " + record::sha256_of_text(head.configuration)}};
    if (!campaign.mark.empty()) rows.push_back({"Marked", "!" + campaign.mark});
    if (campaign.parts.size() > 1)
        rows.push_back(
            {"Parts", fmt::format("{} files, joined in their order", campaign.parts.size())});
    page.table(rows, "words");
    add_journal(page, campaign, a.journal);
    add_files(page, campaign);
    if (!unit.instruments.empty()) {
        Rows table{{"Instrument", "Serial number", "Certificate", "Uncertainty", "Due", ""}};
        const std::string day = utc_text(head.utc_ns).substr(0, 10);
        for (const auto& i : unit.instruments)
            table.push_back({i.name, or_dash(i.serial), or_dash(i.certificate),
                             or_dash(i.uncertainty), or_dash(i.due),
                             i.overdue(day) ? "!overdue at the time of the campaign" : ""});
        page.table(table, "words");
    } else {
        page.paragraph("Instruments: none are stated in the configuration ([[instrument]]).");
    }
}

void add_combinations(Page& page, const Analysis& a) {
    const auto& combinations = a.replayed.result.combinations;
    for (std::size_t i = 0; i < combinations.size(); ++i) {
        std::string sum;
        for (const auto& [name, weight] : combinations[i].weights)
            sum += (sum.empty() ? "" : " + ") + fmt::format("{:.4g} {}", weight, name);
        const bool known = i < a.assessed.combinations.size();
        page.paragraph(fmt::format("Determined together: {} = {:.6f}, {} {:.6f}", sum,
                                   known ? a.assessed.combinations[i].value : combinations[i].value,
                                   known ? "u" : "sigma",
                                   known ? a.assessed.combinations[i].u : combinations[i].sigma));
    }
}

void add_coefficients(Page& page, const Analysis& a) {
    page.section("coefficients", "Coefficients");
    const bool assessed = a.assessed.done;
    page.paragraph(
        assessed ? "Value and interval are the result's: value +- U, as in the section Uncertainty."
                 : "Value and interval are the filter's, of noise alone: the uncertainty was not "
                   "assessed.");
    page.paragraph(
        a.assessed.over_frequency
            ? fmt::format("Of the dwells at rest and at {:g} Hz alone, and of noise alone, are "
                          "sigma, efficiency and correlations, as the filter has them.",
                          a.settings.frequency_hz)
            : "Sigma, efficiency and correlations are the filter's, of noise alone.");
    const std::string percent =
        fmt::format("{:g} % ", assessed ? 100 * a.settings.uncertainty.coverage : 95);
    Rows rows{{"coefficient", "value", "sigma", percent + "from", percent + "to", "unit",
               "expected sigma", "efficiency", "correlates with"}};
    for (std::size_t i = 0; i < kParameters; ++i) {
        const char* name = estimator::parameter_names()[i];
        if (!a.coefficients.observable[i]) {
            rows.push_back({name, "!not determined", "-", "-", "-", estimator::parameter_unit(i),
                            "-", "-", "-"});
            continue;
        }
        const double s = a.coefficients.sigma[i];
        const double v = assessed ? a.assessed.coefficients[i].value : a.coefficients.value[i];
        const double half = assessed ? a.assessed.coefficients[i].expanded : k95 * s;
        std::size_t partner = i == 0 ? 1 : 0;
        for (std::size_t j = 0; j < kParameters; ++j) {
            if (j != i && a.coefficients.observable[j] &&
                std::abs(correlation(a.coefficients, i, j)) >
                    std::abs(correlation(a.coefficients, i, partner)))
                partner = j;
        }
        const double expected = a.expected_sigma[i];
        rows.push_back({name, num(v, 6), num(s, 6), num(v - half, 6), num(v + half, 6),
                        estimator::parameter_unit(i), num(expected, 6), num(expected / s, 2),
                        fmt::format("{} {:+.2f}", estimator::parameter_names()[partner],
                                    correlation(a.coefficients, i, partner))});
    }
    page.table(rows);
    page.paragraph(
        "Expected sigma: Cramer-Rao bound of the plan as it was run, without prior. "
        "Efficiency: that bound over sigma; near 1 the filter takes from the plan what "
        "there is.");
    add_combinations(page, a);
    for (const auto& warning : a.replayed.result.warnings) page.paragraph("Warning: " + warning);
    const Chart chart = correlation_chart([&](std::size_t i, std::size_t j) {
        const bool both = a.coefficients.observable[i] && a.coefficients.observable[j];
        return both ? correlation(a.coefficients, i, j) : std::nan("");
    });
    page.figure(chart.svg(), "In the order of the table: gyro x, y, z.");
}

void add_held_out(Page& page, const Analysis& a) {
    page.section("drift", "Drift before and after");
    if (a.held_out.empty()) return page.paragraph("One position only: nothing can be held out.");
    Chart chart{.title = "Drift on positions held out from the fit",
                .x = Axis("dwell"),
                .y = Axis("drift, absolute, deg/h", true)};
    std::array<double, 2> square{};
    std::size_t count = 0, within = 0;
    Curve before{.name = "before", .look = Look::dots}, after{.name = "after", .look = Look::dots};
    for (std::size_t k = 0; k < 3; ++k) {
        for (std::size_t i = 0; i < a.held_out.size(); ++i) {
            const HeldOut& h = a.held_out[i];
            const auto dwell = static_cast<double>(i + 1);
            before.add(dwell, std::abs(h.before_dph[k]));
            after.add(dwell, h.determined ? std::abs(h.after_dph[k]) : std::nan(""));
            if (!h.determined) continue;
            square[0] += h.before_dph[k] * h.before_dph[k];
            square[1] += h.after_dph[k] * h.after_dph[k];
            ++count;
            if (std::abs(h.after_dph[k]) <= k95 * h.sigma_dph[k]) ++within;
        }
    }
    chart.curves = {before, after};
    page.figure(chart.svg(),
                "All three gyros. Every dwell is judged with coefficients from the other "
                "positions. Before: what the "
                "gyros drift beyond the Earth's rate. After: what is left with the drift model "
                "taken out.");
    if (count > 0) {
        page.paragraph(fmt::format(
            "Root mean square over {} rates: {:.4f} deg/h before, {:.4f} deg/h after, {:.0f} times "
            "less. {} of {} ({:.0f} %) lie within their 95 % interval.",
            count, std::sqrt(square[0] / static_cast<double>(count)),
            std::sqrt(square[1] / static_cast<double>(count)), std::sqrt(square[0] / square[1]),
            within, count, 100.0 * static_cast<double>(within) / static_cast<double>(count)));
    }
    Rows rows{{"run, position", "table g", "before x", "y", "z", "after x", "y", "z", "sigma x",
               "y", "z"}};
    for (const auto& h : a.held_out) {
        std::vector<std::string> row{fmt::format("{}, {}", h.run, h.position), num(h.table_g, 2)};
        for (const double v : h.before_dph) row.push_back(num(v, 4));
        for (std::size_t k = 0; k < 3; ++k)
            row.push_back(!h.determined
                              ? "-"
                              : (std::abs(h.after_dph[k]) > 3 * h.sigma_dph[k] ? "!" : "") +
                                    num(h.after_dph[k], 4));
        for (const double v : h.sigma_dph) row.push_back(num(v, 4));
        rows.push_back(std::move(row));
    }
    page.table(rows);
    page.paragraph(
        "deg/h about the input axes; -: the other positions do not determine it. Sigma: of what is "
        "left, from the coefficients' "
        "covariance, the resolvers and the gyros' random walk.");
}

void add_vibration(Page& page, const Campaign& campaign, const Analysis& a) {
    page.section("vibration", "Vibration");
    const auto& rows = campaign.estimates;
    if (!rows.empty()) {
        const double origin = origin_s(campaign);
        const std::size_t every = std::max<std::size_t>(1, rows.size() / kMostShown);
        Curve amplitude{.look = Look::dots}, frequency{.look = Look::dots};
        for (std::size_t i = 0; i < rows.size(); i += every) {
            amplitude.add(drivers::to_seconds(rows[i].time) - origin, rows[i].amplitude_g);
            frequency.add(drivers::to_seconds(rows[i].time) - origin,
                          rows[i].frequency_hz > 0 ? rows[i].frequency_hz : std::nan(""));
        }
        for (auto* curve : {&amplitude, &frequency}) {
            const bool is_amplitude = curve == &amplitude;
            const Chart chart{.title = is_amplitude ? "Amplitude" : "Frequency",
                              .x = Axis("time, s"),
                              .y = Axis(is_amplitude ? "peak at the platform, g" : "Hz"),
                              .curves = {*curve}};
            page.figure(chart.svg(), "As the filter saw it in its dwells.");
        }
    }
    Rows table{{"run, position", "angles deg", "table g", "platform g", "Hz", "kappa", "samples",
                "rejected", "NIS", "force g", ""}};
    const auto dwells = record::recorded_dwells(campaign);
    for (std::size_t i = 0; i < dwells.size() && i < a.replayed.dwells.size(); ++i) {
        const auto& s = a.replayed.dwells[i].summary;
        table.push_back({fmt::format("{}, {}", s.run, s.position),
                         position_text(campaign, dwells[i]), num(dwells[i].order->table_g, 2),
                         num(s.amplitude_g, 5), num(s.frequency_hz, 3), num(s.kappa, 5),
                         fmt::to_string(s.samples), fmt::to_string(s.rejected),
                         num(s.nis_per_dof, 3), num(s.mean_force_g, 4),
                         s.flagged ? "!" + a.replayed.dwells[i].reason : ""});
    }
    page.table(table);
}

void add_rest(Page& page, const Campaign& campaign, const Analysis& a,
              const std::optional<Earlier>& earlier) {
    page.section("accelerometers", "Levelling and accelerometer zeros");
    const auto& zero = a.settings.accelerometer_zero_g;
    page.paragraph(
        fmt::format("Accelerometer zeros in force: {:.6f}, {:.6f}, {:.6f} g, from the "
                    "configuration.",
                    zero[0], zero[1], zero[2]));
    add_zeros(page, campaign);
    std::size_t shown = 0;
    for (const auto& event : campaign.events) {
        if (!event.text.starts_with("level after") &&
            event.text.find("levelling") == std::string::npos &&
            event.text.find("zero") == std::string::npos)
            continue;
        page.paragraph(event.text);
        ++shown;
    }
    if (shown == 0) page.paragraph("No levelling and no zeroing was done in this campaign.");

    add_spectrum(page, campaign);
    add_type(page, campaign);
    if (!a.history_note.empty()) {
        page.section("history", "Earlier campaigns of the unit");
        page.paragraph(a.history_note);
        if (a.history.size() > 1) page.table(a.history);
    }
    add_comparison(page, campaign, a, earlier);

    page.section("events", "Events");
    Rows rows{{"UTC", "", "from", "what"}};
    for (const auto& event : campaign.events) {
        const std::string severity = name_of(event.severity);
        const bool bad = event.severity == Severity::alarm || event.severity == Severity::trip;
        rows.push_back({utc_text(event.utc_ns).substr(11, 8), (bad ? "!" : "") + severity,
                        event.source, event.text});
    }
    page.table(rows, "words");
    if (!campaign.gaps.empty()) {
        page.paragraph("Missing in the recording:");
        Rows gaps{{"stream", "lost", "why"}};
        for (const auto& gap : campaign.gaps)
            gaps.push_back({gap.stream, fmt::to_string(gap.lost), gap.reason});
        page.table(gaps, "words");
    }
    page.section("configuration", "Configuration");
    if (!a.anew_with.empty())
        page.paragraph("Of the recording. The result is one of the settings in " + a.anew_with +
                       ".");
    page.paragraph("Hash of what the results depend on: " + campaign.head.configuration_hash);
    page.details("Effective configuration", campaign.head.configuration);
}

}  // namespace

std::string make_page(const Campaign& campaign, const Analysis& analysis,
                      const std::optional<Earlier>& earlier) {
    Page page;
    if (campaign.head.simulated) page.mark("SIMULATED");
    add_head(page, campaign, analysis);
    add_uncertainty(page, analysis.assessed, analysis.settings.uncertainty.coverage);
    add_lead(page, campaign, analysis.replayed);
    add_coefficients(page, analysis);
    add_campaign(page, campaign, analysis);
    add_plan(page, campaign, analysis);
    add_held_out(page, analysis);
    add_convergence(page, campaign, analysis);
    add_innovations(page, analysis);
    add_vibration(page, campaign, analysis);
    add_conditions(page, campaign);
    add_noise(page, campaign, analysis);
    add_proof(page, campaign);
    add_rest(page, campaign, analysis, earlier);
    return page.html("Vibration test of " + campaign.head.name);
}

}  // namespace vibrig::report
