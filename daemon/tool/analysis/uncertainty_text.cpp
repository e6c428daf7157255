#include "daemon/tool/analysis/uncertainty_text.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "daemon/results/text_line.hpp"
#include "estimator/filter/median.hpp"

namespace vibrig::tool {
namespace {

using namespace estimator::uncertainty;

/// Parts shown of each coefficient, and pieces of advice.
constexpr std::size_t kPartsShown = 3, kAdviceShown = 3;
/// Correlations that are less of u are left out.
constexpr double kSmallest = 0.05;

/// Elements of one input together.
std::vector<Contribution> joined_parts(const std::vector<Contribution>& parts) {
    std::vector<Contribution> list;
    for (const Contribution& part : parts) {
        const auto at = std::find_if(list.begin(), list.end(), [&](const Contribution& one) {
            return one.input == part.input;
        });
        if (at == list.end()) {
            list.push_back(part);
        } else {
            at->contribution = std::hypot(at->contribution, part.contribution);
        }
    }
    std::stable_sort(list.begin(), list.end(),
                     [](const auto& a, const auto& b) { return a.contribution > b.contribution; });
    return list;
}

std::string of_all(const Assessment& assessed) {
    std::string text = line("%-12s %11s %10s %10s %6s  %s", "coefficient", "value", "u", "U", "k",
                            "largest parts of u");
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        const Coefficient& c = assessed.coefficients[i];
        if (!(c.u > 0)) {
            text += line("%-12s not determined", estimator::parameter_names()[i]);
            continue;
        }
        std::string parts;
        for (const Contribution& part : joined_parts(c.budget)) {
            if (std::count(parts.begin(), parts.end(), ';') + 1 > static_cast<long>(kPartsShown))
                break;
            parts += part.input + (part.declared ? " " : " (not declared) ") +
                     line("%.2g;", part.contribution);
            parts.back() = ' ';
        }
        if (std::abs(c.correlation_part()) >= kSmallest * c.u)
            parts += proto::printed("correlations %.2g", c.correlation_part());
        text += line("%-12s %11.6f %10.6f %10.6f %6.2f  %s", estimator::parameter_names()[i],
                     c.value, c.u, c.expanded, c.k, parts.c_str());
    }
    return text;
}

std::string of_one(const Assessment& assessed, std::size_t i) {
    const Coefficient& c = assessed.coefficients[i];
    const char* unit = estimator::parameter_unit(i);
    if (!(c.u > 0)) return line("%s: not determined", estimator::parameter_names()[i]);
    std::string text = line("%s = %.6f, u %.6f, U %.6f %s (k %.2f)",
                            estimator::parameter_names()[i], c.value, c.u, c.expanded, unit, c.k);
    text += line("%-24s %-28s %11s %11s %12s  %s", "input", "", "u of it", "c", "part of u", "");
    for (const Contribution& part : c.budget)
        text +=
            line("%-24s %-28s %11.3g %11.3g %12.3g  %s", part.input.c_str(), part.element.c_str(),
                 part.u, part.sensitivity, part.contribution, part.declared ? "" : "not declared");
    if (c.correlation != 0)
        text += line("%-24s %-28s %11s %11s %12.3g  %s", "correlations", "of the inputs", "", "",
                     c.correlation_part(), c.correlation < 0 ? "its square comes off" : "");
    return text;
}

std::string advices(const Assessment& assessed) {
    std::string text;
    std::size_t shown = 0;
    for (const Leverage& of : leverages(assessed)) {
        if (shown == kAdviceShown || of.without[of.strongest()] > 0.98) break;
        text += (shown++ == 0 ? "what shrinks it most: " : "then: ") + advice(of) + "\n";
    }
    return text;
}

double middle_of(std::vector<double>& values) {
    return values.empty() ? kNone : estimator::median(values);
}

}  // namespace

std::string budget_table(const Assessment& assessed, std::optional<std::size_t> only) {
    return (only ? of_one(assessed, *only) : of_all(assessed)) + "\n" + advices(assessed) +
           "verdict: " + assessed.verdict.sentence + "\n";
}

std::string allowance_table(const Assessment& assessed) {
    constexpr std::array<const char*, kKinds> kUnits{"deg/h", "deg/h/g", "deg/h/g^2", "deg/h/g^2"};
    std::string text = line("With the declared inputs, medians:\n%-14s %10s %10s %10s  %s", "",
                            "sigma", "u", "U", "unit");
    for (std::size_t k = 0; k < kKinds; ++k) {
        std::array<std::vector<double>, 3> values;
        for (std::size_t i = 0; i < estimator::kParameters; ++i) {
            const Coefficient& c = assessed.coefficients[i];
            if (kind_of(i) != k || !(c.u > 0)) continue;
            values[0].push_back(c.noise);
            values[1].push_back(c.u);
            values[2].push_back(c.expanded);
        }
        text += line("%-14s %10.5f %10.5f %10.5f  %s", kind_name(k), middle_of(values[0]),
                     middle_of(values[1]), middle_of(values[2]), kUnits[k]);
    }
    return text + advices(assessed);
}

}  // namespace vibrig::tool
