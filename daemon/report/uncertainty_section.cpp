#include "daemon/report/uncertainty_section.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>

#include "daemon/report/result_charts.hpp"
#include "estimator/uncertainty/leverage.hpp"

namespace vibrig::report {

namespace uncertainty = estimator::uncertainty;

namespace {

/// Lesser parts of the budget are left to `vibrig uncertainty`.
constexpr double kSmallest = 0.05;
constexpr std::size_t kMostPatterns = 8;

std::vector<std::vector<std::string>> budget_rows(const uncertainty::Assessment& a) {
    std::vector<std::vector<std::string>> rows{
        {"coefficient", "value", "U", "k", "unit", "u", "noise alone", "largest parts of u"}};
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        const auto& c = a.coefficients[i];
        const char* name = estimator::parameter_names()[i];
        if (!(c.u > 0)) {
            rows.push_back(
                {name, "!not determined", "-", "-", estimator::parameter_unit(i), "-", "-", "-"});
            continue;
        }
        std::string parts;
        for (const auto& part : c.budget) {
            if (part.contribution < kSmallest * c.u) break;
            parts += fmt::format("{}{}{}{} {:.2g}", parts.empty() ? "" : "; ", part.input,
                                 part.element.empty() ? "" : " " + part.element,
                                 part.declared ? "" : " (not declared)", part.contribution);
        }
        rows.push_back({name, fmt::format("{:.6f}", c.value), fmt::format("{:.6f}", c.expanded),
                        fmt::format("{:.2f}", c.k), estimator::parameter_unit(i),
                        fmt::format("{:.6f}", c.u), fmt::format("{:.6f}", c.sigma), parts});
    }
    return rows;
}

}  // namespace

void add_uncertainty(Page& page, const uncertainty::Assessment& a) {
    page.section("uncertainty", "Uncertainty and verdict");
    const bool valid = a.verdict.level == uncertainty::Level::valid;
    page.table({{"verdict"}, {(valid ? "" : "!") + a.verdict.sentence}});
    for (std::size_t i = 1; i < a.verdict.reasons.size(); ++i)
        page.paragraph("Also: " + a.verdict.reasons[i].text);
    if (!a.done) return;
    page.table(budget_rows(a), "budget");
    page.paragraph(
        "u combines noise, a bias that may have moved during the campaign, and the inputs declared "
        "in the configuration; U = k u covers with the probability declared. Where nothing was "
        "declared a default stands in.");
    for (const auto& of : uncertainty::leverages(a)) {
        page.paragraph("What would shrink it most: " + uncertainty::advice(of) + ".");
        break;
    }
    std::vector<std::vector<std::string>> evidence{
        {"what the dwells might show", "log of the odds against nothing"}};
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
