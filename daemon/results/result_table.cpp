#include "daemon/results/result_table.hpp"

#include <cmath>
#include <string_view>

#include "daemon/results/exit_status.hpp"
#include "daemon/results/result_json.hpp"
#include "daemon/results/text_line.hpp"

namespace vibrig::tool {

namespace {

using estimator::uncertainty::Assessment;

std::string number(const char* format, double value) {
    return std::isfinite(value) ? printed(format, value) : "-";
}

const char* unit_of(std::string_view name) {
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        if (name == estimator::parameter_names()[i]) {
            return estimator::parameter_unit(i);
        }
    }
    return "";
}

std::string with_uncertainty(const estimator::Result& result, const Assessment& assessed) {
    std::string text = line("%-12s %12s %11s %11s %11s  %-10s %s", "coefficient", "value", "u", "U",
                            "sigma", "unit", "observable");
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        const auto& of = assessed.coefficients[i];
        text += line("%-12s %12s %11s %11s %11s  %-10s %s", estimator::parameter_names()[i],
                     number("%.6f", of.value).c_str(), number("%.6f", of.u).c_str(),
                     number("%.6f", of.expanded).c_str(), number("%.6f", of.noise).c_str(),
                     estimator::parameter_unit(i), result.observable[i] ? "yes" : "no");
    }
    return text;
}

/// sigma is noise alone; u is all that is known of, and U covers with the probability declared.
std::string coefficients(const estimator::Result& result, const Assessment& assessed) {
    if (assessed.done) return with_uncertainty(result, assessed);
    std::string text =
        line("%-12s %12s %11s  %-10s %s", "coefficient", "value", "sigma", "unit", "observable");
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        const bool shown = result.observable[i];
        text += line("%-12s %12s %11s  %-10s %s", estimator::parameter_names()[i],
                     shown ? number("%.6f", result.value[i]).c_str() : "-",
                     shown ? number("%.6f", result.sigma[i]).c_str() : "-",
                     estimator::parameter_unit(i), shown ? "yes" : "no");
    }
    return text;
}

std::string verdict(const Assessment& assessed) {
    const auto& of = assessed.verdict;
    std::string text = "verdict: " + of.sentence + "\n";
    for (std::size_t i = 1; i < of.reasons.size(); ++i)
        text += "  also: " + of.reasons[i].text + "\n";
    for (const auto& one : assessed.freed)
        text += line("freed: %s%s%s %.3g +- %.2g %s", one.of_class.c_str(),
                     one.element.empty() ? "" : ", ", one.element.c_str(), one.value, one.sigma,
                     one.unit.c_str());
    return text;
}

/// Without a line near the nominal frequency it is at rest only where nothing vibrates.
std::string frequency(const estimator::RunAmplitude& run) {
    if (run.frequency_hz > 0) return number("%.4f", run.frequency_hz);
    return run.at_rest() ? "at rest" : "no line";
}

std::string amplitude_lines(const estimator::Result& result) {
    std::string text = line("%-12s %12s %11s  %12s %12s", "run", "amplitude g", "sigma g", "kappa",
                            "frequency Hz");
    for (const estimator::RunAmplitude& run : result.amplitudes) {
        text += line("%-12d %12s %11s  %12s %12s", run.run, number("%.6f", run.amplitude_g).c_str(),
                     number("%.2g", run.sigma_g).c_str(), number("%.6f", run.kappa).c_str(),
                     frequency(run).c_str());
    }
    return text;
}

/// `determined`: null where there is no assessment.
std::string words(const estimator::Combination& combination,
                  const estimator::uncertainty::Determined* determined) {
    std::string sum;
    for (const auto& [name, weight] : combination.weights) {
        const double size = std::abs(weight);
        sum += sum.empty() ? (weight < 0 ? "-" : "") : (weight < 0 ? " - " : " + ");
        sum += (size == 1 ? "" : number("%.6g", size) + " ") + name;
    }
    const char* unit = combination.weights.empty() ? "" : unit_of(combination.weights[0].first);
    const std::string sigma = "sigma " + number("%.6f", combination.sigma);
    if (determined == nullptr)
        return line("  %s = %s, %s %s", sum.c_str(), number("%.6f", combination.value).c_str(),
                    sigma.c_str(), unit);
    return line("  %s = %s, u %s, %s %s", sum.c_str(), number("%.6f", determined->value).c_str(),
                number("%.6f", determined->u).c_str(), sigma.c_str(), unit);
}

std::string not_observable(const estimator::Result& result, const Assessment& assessed) {
    std::string names;
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        if (!result.observable[i]) {
            names += std::string(" ") + estimator::parameter_names()[i];
        }
    }
    std::string text = "Not observable one by one from this recording:" + names + "\n";
    if (result.combinations.empty()) {
        return text + "No combination of them is determined either.\n";
    }
    text += "Determined are these combinations of them:\n";
    for (std::size_t i = 0; i < result.combinations.size(); ++i)
        text += words(result.combinations[i],
                      i < assessed.combinations.size() ? &assessed.combinations[i] : nullptr);
    return text;
}

}  // namespace

int exit_status(estimator::uncertainty::Level level, bool strict) {
    using estimator::uncertainty::Level;
    return level == Level::not_valid || (strict && level == Level::doubtful) ? kNo : 0;
}

std::string monte_carlo_text(const estimator::uncertainty::MonteCarlo& drawn) {
    std::string text = line(
        "Monte Carlo (JCGM 101): %d blocks of 10000%s; the ends of the intervals agree with U "
        "within %.2f of the tolerance (%d digit%s): %s",
        drawn.blocks, drawn.stable ? "" : ", not yet stable", drawn.largest_difference,
        drawn.digits, drawn.digits == 1 ? "" : "s",
        drawn.gum_confirmed ? "confirmed" : "NOT CONFIRMED");
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        const auto& of = drawn.coefficients[i];
        if (of.u > 0 && !of.confirmed)
            text += line("  %s: %.6f to %.6f", estimator::parameter_names()[i], of.low, of.high);
    }
    if (drawn.nonlinearity > 0.05)
        text += line("warning: the inputs do not act linearly, by %.0f %% of their effect",
                     100 * drawn.nonlinearity);
    return text;
}

std::string result_table(const estimator::Result& result, const Assessment& assessed) {
    std::string text = coefficients(result, assessed) + "\nVibration on the platform (peak):\n" +
                       amplitude_lines(result) + "\n";
    text += "samples " + std::to_string(result.samples) + ", rejected " +
            std::to_string(result.rejected) + ", NIS per degree of freedom " +
            number("%.4f", result.nis_per_dof) + "\n";
    if (const estimator::CrossCheck& check = result.cross_check; check.done) {
        text += "batch least squares over the same readings: largest difference " +
                number("%.2g", check.largest) + " sigma (" + check.coefficient + "), " +
                (check.agrees() ? "agrees" : "DISAGREES") + " (limit " +
                number("%g", estimator::CrossCheck::kLimit) + ")\n";
    }
    if (!all_observable(result)) {
        text += "\n" + not_observable(result, assessed);
    }
    text += "\n" + verdict(assessed);
    for (const std::string& warning : result.warnings) {
        text += "warning: " + warning + "\n";
    }
    return text;
}

}  // namespace vibrig::tool
