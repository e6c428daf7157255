#include "daemon/report/sections.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "daemon/report/result_charts.hpp"
#include "estimator/uncertainty/leverage.hpp"

namespace vibrig::report {

namespace uncertainty = estimator::uncertainty;

namespace {

/// Lesser parts of the budget are left to `vibrig uncertainty`.
constexpr double kSmallest = 0.05;
constexpr std::size_t kMostParts = 3;
constexpr std::size_t kMostPatterns = 8;

/// Elements of one input, such as three axes, as the root of their squares' sum; largest first.
std::string largest_parts(const uncertainty::Coefficient& c) {
    struct Part {
        std::string input;
        double square = 0;
        bool declared = true;
    };
    std::vector<Part> parts;
    for (const auto& one : c.budget) {
        auto part = std::ranges::find(parts, one.input, &Part::input);
        if (part == parts.end()) part = parts.insert(part, {one.input});
        part->square += one.contribution * one.contribution;
        part->declared = part->declared && one.declared;
    }
    std::ranges::stable_sort(parts, std::greater{}, &Part::square);
    std::string text;
    for (std::size_t i = 0; i < std::min(parts.size(), kMostParts); ++i) {
        auto& [input, square, declared] = parts[i];
        if (!(std::sqrt(square) >= kSmallest * c.u)) break;
        std::ranges::replace(input, '_', ' ');
        text += fmt::format("{}{}{} {:.2g}", text.empty() ? "" : ", ", input, declared ? "" : "*",
                            std::sqrt(square));
    }
    if (std::abs(c.correlation_part()) >= kSmallest * c.u)
        text +=
            fmt::format("{}correlations {:.2g}", text.empty() ? "" : ", ", c.correlation_part());
    return text;
}

Rows budget_rows(const uncertainty::Assessment& a) {
    Rows rows{{"coefficient", "value", "U", "k", "unit", "u", "noise alone", "largest parts of u"}};
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        const auto& c = a.coefficients[i];
        const char* name = estimator::parameter_names()[i];
        if (!(c.u > 0)) {
            rows.push_back(
                {name, "!not determined", "-", "-", estimator::parameter_unit(i), "-", "-", "-"});
            continue;
        }
        const std::string parts = largest_parts(c);
        rows.push_back({name, fmt::format("{:.6f}", c.value), fmt::format("{:.6f}", c.expanded),
                        fmt::format("{:.2f}", c.k), estimator::parameter_unit(i),
                        fmt::format("{:.6f}", c.u), fmt::format("{:.6f}", c.noise), parts});
    }
    return rows;
}

}  // namespace

void add_uncertainty(Page& page, const uncertainty::Assessment& a, double coverage) {
    page.section("uncertainty", "Uncertainty and verdict");
    const bool valid = a.verdict.level == uncertainty::Level::valid;
    page.table({{"verdict"}, {(valid ? "" : "!") + a.verdict.sentence}});
    for (std::size_t i = 1; i < a.verdict.reasons.size(); ++i)
        page.paragraph("Also: " + a.verdict.reasons[i].text);
    if (!a.done) return;
    page.table(budget_rows(a), "budget");
    page.paragraph(fmt::format(
        "u combines noise, a bias that may have moved during the campaign, and the inputs declared "
        "in the configuration; U = k u, with the k given, covers with a probability of about {:g} "
        "%. *: nothing was declared, a default stands in.",
        100 * coverage));
    if (std::ranges::any_of(a.coefficients, [](const auto& c) { return c.correlation != 0; }))
        page.paragraph(
            "Squared, the parts add up to u squared; with a minus sign, what correlations of the "
            "inputs have is taken off.");
    for (const auto& of : uncertainty::leverages(a)) {
        page.paragraph("What would shrink it most: " + uncertainty::advice(of) + ".");
        break;
    }
    Rows evidence{{"what the dwells might show", "log of the odds against nothing"}};
    for (const auto& e : a.evidence) {
        if (evidence.size() > kMostPatterns) break;
        evidence.push_back({uncertainty::name_of(e.pattern),
                            fmt::format("{}{:.1f}", e.named() ? "!" : "", e.log_odds)});
    }
    if (evidence.size() > 1) page.table(evidence);
    page.figure(residuals_chart(a).svg(),
                "About the model with constant coefficients, 1 sigma of noise and declared "
                "inputs.");
}

}  // namespace vibrig::report
