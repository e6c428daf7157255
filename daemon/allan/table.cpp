#include <array>
#include <cmath>

#include "daemon/allan/analysis.hpp"
#include "daemon/results/text_line.hpp"

namespace vibrig::tool {

namespace {

constexpr double kShownWeight = 0.05;

const char* noise_name(allan::Alpha alpha) {
    constexpr std::array<const char*, 4> kFromFlicker{"flicker FM", "white FM", "flicker PM",
                                                      "white PM"};
    return alpha >= -1 && alpha <= 2 ? kFromFlicker[static_cast<std::size_t>(alpha + 1)]
                                     : "random walk";
}

std::string fit_table(const allan::Fit& fit) {
    std::string out;
    for (std::size_t j = 0; j < allan::kTerms; ++j) {
        const allan::FittedTerm& term = fit.terms[j];
        if (term.detected) {
            out += printed("  %s  %11.4g +- %-9.2g %s\n", allan::kTermNames[j], term.value,
                           term.sigma, allan::kTermUnits[j]);
        } else if (std::isfinite(term.below)) {
            out += printed("  %s  not detected, below %.2g %s\n", allan::kTermNames[j], term.below,
                           allan::kTermUnits[j]);
        } else {
            out += printed("  %s  not detected, no bound\n", allan::kTermNames[j]);
        }
    }
    if (const std::string verdict = fit.verdict(); !verdict.empty()) out += "  " + verdict + "\n";
    out += "  terms that explain the curve:";
    for (const allan::NoiseModel& model : fit.models) {
        if (model.weight < kShownWeight) continue;
        out += ' ';
        for (std::size_t j = 0; j < allan::kTerms; ++j)
            out += model.terms[j] ? allan::kTermNames[j] : "";
        out += printed(" %.0f %%", 100 * model.weight);
    }
    return out + "\n";
}

std::string windows_table(const AllanAnalysis& analysis) {
    std::string out = "\n  centre [s]      mean [deg/h]";
    for (std::size_t j = 0; j < allan::kTerms; ++j) {
        out += printed(" %10s", allan::kTermNames[j]);
    }
    out += "  alarms\n";
    for (const auto& [row, alarms] : analysis.windows) {
        out += printed("%12.6g ", row.centre_s);
        out += std::isnan(row.mean) ? printed("%17s", "-") : printed("%17.6g", row.mean);
        if (row.refused) {
            out += printed("  refused: %zu samples missing, or nothing varies\n", row.missing);
            continue;
        }
        for (const allan::FittedTerm& term : row.fit.terms) {
            out +=
                term.detected ? printed(" %10.3g", term.value) : printed("   < %6.1g", term.below);
        }
        out += printed("  %zu\n", alarms.size());
        for (const allan::Alarm& alarm : alarms) {
            out += alarm_text(alarm) + "\n";
        }
    }
    return out;
}

std::string summary_table(const AllanAnalysis& analysis) {
    const allan::DynamicSummary& summary = *analysis.summary;
    std::string out =
        printed("\n%zu windows, %zu refused, %llu faults of the running sums\n", summary.windows,
                summary.refused, static_cast<unsigned long long>(summary.faults));
    if (analysis.smallest_change > 0) {
        out += printed("a window shows a change of N of %.2g %% or more\n",
                       100 * analysis.smallest_change);
    }
    if (summary.windows == 0) {
        return out;
    }
    out += "Fit of the mean Allan variance of the windows:\n" + fit_table(summary.fit);
    out += "Classical coefficients, averaged over the windows, mapped:\n ";
    for (std::size_t j = 0; j < allan::kTerms; ++j) {
        const double value = summary.classical.terms[j];
        out += std::isnan(value) ? printed("  %s -", allan::kTermNames[j])
                                 : printed("  %s %.4g", allan::kTermNames[j], value);
    }
    allan::Polynomial a = summary.classical.a;
    a[0] = summary.classical.a0_known ? a[0] : 0;
    out += printed("\n  class sums [(deg/h)^2], slow%s and fast:",
                   summary.classical.a0_known ? "" : " without a0");
    for (const std::size_t k :
         {std::size_t{0}, analysis.factors.size() / 2, analysis.factors.size() - 1}) {
        const double tau = static_cast<double>(analysis.factors[k]) * analysis.request.tau0;
        const allan::ClassSums sums = allan::class_sums(a, tau);
        out += printed("%s tau %.4g s %.3g, %.3g", k == 0 ? "" : ";", tau, sums.slow, sums.fast);
    }
    out += "\n";
    for (const std::string& note : summary.classical.notes) {
        out += "  " + note + "\n";
    }
    return out;
}

}  // namespace

std::string alarm_text(const allan::Alarm& alarm) {
    return printed("      alarm since %.6g s at tau %.4g s: ratio %.3g, limit %.3g; %s",
                   alarm.since_s, alarm.tau, alarm.ratio, alarm.limit,
                   allan::words_of(alarm.reading));
}

std::string allan_table(const AllanAnalysis& analysis) {
    const AllanRequest& request = analysis.request;
    std::string out = printed("%s of %zu samples at %.6g s, intervals at %.4g %%\n\n",
                              allan::name_of(request.statistic), analysis.samples, request.tau0,
                              100 * request.confidence);
    out += "     tau [s]          dev           lo           hi       edf        n  noise\n";
    for (const allan::Point& p : analysis.points) {
        out += printed("%12.6g %12.6g %12.6g %12.6g %9.1f %8zu  %s\n", p.tau, p.dev, p.lo, p.hi,
                       p.edf, p.n, noise_name(p.alpha));
    }
    if (analysis.fit) {
        out += "\n" + fit_table(*analysis.fit);
    }
    if (analysis.summary) {
        out += windows_table(analysis) + summary_table(analysis);
    }
    for (const std::string& warning : analysis.warnings) {
        out += "note: " + warning + "\n";
    }
    return out;
}

}  // namespace vibrig::tool
