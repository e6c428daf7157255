#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "daemon/report/certificate.hpp"
#include "daemon/report/page.hpp"
#include "daemon/report/paperwork.hpp"

namespace vibrig::report {

using Json = nlohmann::ordered_json;

namespace {

/// Digits that two of the uncertainty's leave (JCGM 100, 7.2.6).
int digits_of(double expanded) {
    return std::clamp(1 - static_cast<int>(std::floor(std::log10(expanded))), 0, 12);
}

std::string fixed(double value, int digits) { return fmt::format("{:.{}f}", value, digits); }

std::string text(const Json& of, const char* name) { return or_dash(of.value(name, "")); }

/// As it stands in the JSON: a statement of conformity rests on all its digits.
std::string number_or(const Json& value, const char* none) {
    return value.is_number() ? fmt::format("{}", value.get<double>()) : none;
}

void add_who(Page& page, const Json& c) {
    const auto &lab = c["laboratory"], &customer = c["customer"], &item = c["item"],
               &dates = c["dates"];
    page.section("about", "Laboratory, customer, item");
    page.table({{"", ""},
                {"Laboratory", text(lab, "name") + ", " + text(lab, "address")},
                {"Measured at", lab.value("location", "").empty() ? "the laboratory's address"
                                                                  : text(lab, "location")},
                {"Accreditation", text(lab, "accreditation")},
                {"Customer", text(customer, "name") + ", " + text(customer, "address")},
                {"Item", item.value("what", "") + ", " + text(item, "type") + ", serial number " +
                             text(item, "serial")},
                {"Received", text(item, "received") + ", condition: " + text(item, "condition")},
                {"Calibrated", dates.value("begun", "") + " to " + dates.value("ended", "")},
                {"Issued", dates.value("issued", "") + " by " + text(c, "issued_by")},
                {"Performed by", text(c, "performed_by") + ", campaign " + text(c, "campaign")}},
               "words");
}

/// Of which vibration a coefficient is: bias and linear terms are of any.
std::string vibration_of(const Json& result) {
    const Json hz = result.value("at_hz", Json());
    if (result.value("unit", "") != "deg/h/g^2") return "any";
    if (!hz.is_number()) return "no single frequency";
    return hz == 0 ? "static" : fmt::format("{:g} Hz", hz.get<double>());
}

void add_results(Page& page, const Json& c) {
    page.section("results", "Results");
    const auto& verdict = c["verdict"];
    if (verdict.value("word", "") != "valid") {
        page.paragraph("The result is DOUBTFUL:");
        for (const auto& reason : verdict["reasons"])
            page.paragraph("- " + reason.value("text", ""));
    }
    if (!c.value("mark", "").empty()) page.paragraph("Marked: " + c.value("mark", ""));
    const bool over_frequency = !c["frequencies"].is_null();
    Rows rows{{"coefficient", "value", "U", "k", "unit"}};
    if (over_frequency) rows[0].emplace_back("vibration");
    for (const auto& r : c["results"]) {
        const double expanded = r["expanded"];
        const int digits = digits_of(expanded);
        rows.push_back({r["name"], fixed(r["value"], digits), fixed(expanded, digits),
                        fixed(r["k"], 2), r["unit"]});
        if (over_frequency) rows.back().push_back(vibration_of(r));
    }
    page.table(rows);
    if (over_frequency) page.paragraph(c["frequencies"].value("words", ""));
    page.paragraph(c["coverage"]);
}

void add_statements(Page& page, const Json& c) {
    if (c["statements"].empty()) return;
    page.section("conformity", "Statement of conformity");
    Rows rows{{"coefficient", "from", "to", "unit", "statement"}};
    for (const auto& s : c["statements"]) {
        const std::string word = s["statement"];
        rows.push_back({s["coefficient"], number_or(s["low"], "-"), number_or(s["high"], "-"),
                        s["unit"], (word == "passes" ? "" : "!") + word});
    }
    page.table(rows);
    page.paragraph("Decision rule: " + c["decision_rule"].value("words", ""));
}

void add_method(Page& page, const Json& c) {
    page.section("method", "Method and conditions");
    page.paragraph(c["method"]);
    page.paragraph(c["equation"]);
    page.paragraph(c["deviations"].empty() ? "Deviations from the method: none."
                                           : "Deviations from the method:");
    for (const auto& deviation : c["deviations"])
        page.paragraph("- " + deviation.get<std::string>());
    Rows rows{{"condition", "least", "mean", "greatest", "unit"}};
    for (const auto& r : c["conditions"])
        rows.push_back({r["what"], fixed(r["least"], 2), fixed(r["mean"], 2),
                        fixed(r["greatest"], 2), r["unit"]});
    if (rows.size() > 1) {
        page.table(rows);
    } else {
        page.paragraph("Environmental conditions: none were recorded.");
    }
    page.section("traceability", "Traceability");
    Rows instruments{{"Instrument", "Serial number", "Certificate", "Uncertainty", "Due", ""}};
    for (const auto& i : c["traceability"])
        instruments.push_back({i["name"], text(i, "serial"), text(i, "certificate"),
                               text(i, "uncertainty"), text(i, "due"),
                               i.value("overdue", false) ? "!overdue at the time" : ""});
    if (instruments.size() > 1) {
        page.table(instruments, "words");
    } else {
        page.paragraph("No instruments are stated.");
    }
}

/// A row for each coefficient, a column for each input, and one of correlations where there are
/// any.
Rows budget_of(const Json& budget, const Json& correlation) {
    std::vector<std::string> inputs;
    for (const auto& parts : budget) {
        for (const auto& part : parts) {
            const std::string input = part.value("input", "");
            if (std::ranges::find(inputs, input) == inputs.end()) inputs.push_back(input);
        }
    }
    Rows rows{{"coefficient"}};
    for (std::string input : inputs) {
        std::ranges::replace(input, '_', ' ');
        rows.front().push_back(input);
    }
    if (!correlation.empty()) rows.front().emplace_back("correlations");
    for (const auto& [name, parts] : budget.items()) {
        std::vector<double> squares(inputs.size());
        for (const auto& part : parts) {
            const auto column = std::ranges::find(inputs, part.value("input", ""));
            const auto contribution = part.find("contribution");
            if (contribution == part.end() || !contribution->is_number()) continue;
            squares[static_cast<std::size_t>(column - inputs.begin())] +=
                std::pow(contribution->get<double>(), 2);
        }
        rows.push_back({name});
        for (const double square : squares)
            rows.back().push_back(fmt::format("{:.1e}", std::sqrt(square)));
        if (correlation.empty()) continue;
        const double variance = correlation.value(name, 0.0);
        rows.back().push_back(
            fmt::format("{:.1e}", std::copysign(std::sqrt(std::abs(variance)), variance)));
    }
    return rows;
}

void add_annex(Page& page, const Json& c) {
    const auto& annex = c["annex"];
    page.section("annex", "Annex");
    page.paragraph("Replay: " + annex.value("replay", ""));
    Rows rows{{"What", "SHA-256"}};
    for (const auto& file : annex["recording"]) rows.push_back({file["file"], file["sha256"]});
    rows.push_back({"configuration", annex["configuration_sha256"]});
    rows.push_back({"result", annex["result_sha256"]});
    page.table(rows, "words hashes");
    const Json correlation = annex.value("correlation_variance", Json::object());
    if (const auto budget = budget_of(annex["budget"], correlation); budget.size() > 1) {
        page.paragraph(
            "Contributions to u, in the coefficient's unit; what comes in several elements, such "
            "as three axes, as the root of their squares' sum. One by one they are in the JSON.");
        if (!correlation.empty())
            page.paragraph(
                "Correlations of the inputs: with a minus sign, the square is taken off the "
                "others' "
                "squares.");
        page.table(budget, "matrix");
    }
    page.paragraph("Recorded by " + annex.value("recorded_by", "") + ", issued with " +
                   annex.value("issued_with", "") + ".");
    page.paragraph("End of certificate " + c.value("number", "") + ".");
}

}  // namespace

std::string certificate_page(const Json& certificate) {
    Page page;
    if (certificate.value("simulated", false)) page.mark("SIMULATED");
    if (certificate["verdict"].value("word", "") != "valid") page.mark("DOUBTFUL");
    page.foot("Certificate " + certificate.value("number", "") + ", " +
              certificate["laboratory"].value("name", ""));
    page.paragraph("Number " + certificate.value("number", "") + ". " +
                   text(certificate["laboratory"], "name"));
    add_who(page, certificate);
    add_results(page, certificate);
    add_statements(page, certificate);
    add_method(page, certificate);
    page.section("remarks", "Remarks");
    for (const auto& remark : certificate["remarks"]) page.paragraph(remark);
    add_annex(page, certificate);
    return page.html(certificate.value("title", ""), {"Performed by, date", "Authorised by, date"});
}

}  // namespace vibrig::report
