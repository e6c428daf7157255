#include "daemon/tool/analysis/rig_doubts.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "estimator/commissioning/told_apart.hpp"
#include "estimator/filter/settings_check.hpp"

namespace vibrig::tool {

namespace {

namespace commissioning = estimator::commissioning;

/// As the filter: beyond it the level of a dwell is not known.
constexpr double kMeanForce_g = 0.02;

/// What shook at another frequency, or is held out, drifts otherwise than the coefficients say.
bool is_apart(const estimator::DwellSummary& dwell, const std::vector<estimator::DwellRow>& rows) {
    return std::ranges::any_of(rows, [&dwell](const estimator::DwellRow& row) {
        return row.apart && row.run == dwell.run && row.position == dwell.position;
    });
}

}  // namespace

std::string RigDoubts::tell(estimator::Result& result,
                            const std::vector<estimator::DwellRow>& rows) const {
    for (const auto& doubt : estimator::doubtful_keys(settings_))
        result.warnings.push_back(doubt.key + ": found " + doubt.found + ", expected " +
                                  doubt.expected);
    // A dwell that was never ended has no summary.
    if (dwells_.size() != result.dwells.size()) return {};
    std::vector<commissioning::DwellMean> means;
    for (std::size_t i = 0; i < dwells_.size(); ++i) {
        const auto& summary = result.dwells[i];
        if (!dwells_[i].known() || is_apart(summary, rows)) continue;
        const bool level = std::abs(summary.mean_force_g - 1) <= kMeanForce_g;
        means.push_back(dwells_[i].mean(level ? summary.kappa : 1, level));
    }
    const auto found = commissioning::consistency(settings_, means);
    for (const auto& contradiction : found.contradictions)
        result.warnings.push_back("configuration and recording do not fit: " + contradiction);
    if (found.contradictions.empty()) return {};
    const auto list = commissioning::suspects(settings_, means);
    std::string suspects;
    for (const auto& suspect : list) suspects += (suspects.empty() ? "" : "; ") + suspect.words;
    if (const auto apart = commissioning::told_apart_words(settings_, list); !apart.empty())
        suspects += "; " + apart;
    result.warnings.push_back(suspects.empty() ? "no single key explains it"
                                               : "suspects, best first: " + suspects);
    return found.contradictions.front();
}

void contradict(estimator::uncertainty::Verdict& verdict, const std::string& contradiction) {
    if (contradiction.empty()) return;
    using estimator::uncertainty::Level;
    const std::string text = "the configuration does not fit the recording: " + contradiction;
    verdict.level = Level::not_valid;
    verdict.reasons.insert(verdict.reasons.begin(), {"configuration", text, Level::not_valid});
    verdict.sentence = "not valid, because " + text;
}

}  // namespace vibrig::tool
