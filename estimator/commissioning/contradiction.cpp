#include "estimator/commissioning/contradiction.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/commissioning/consistency.hpp"
#include "estimator/commissioning/told_apart.hpp"

namespace vibrig::estimator::commissioning {

namespace {

/// As the filter: beyond it the level of a dwell is not known.
constexpr double kMeanForce_g = 0.02;

}  // namespace

Contradiction contradiction_of(const Settings& settings, const std::vector<DwellSummary>& dwells,
                               const std::vector<DwellMeans>& means) {
    std::vector<DwellMean> known;
    for (std::size_t i = 0; i < std::min(dwells.size(), means.size()); ++i) {
        if (!means[i].known()) continue;
        const bool level = std::abs(dwells[i].mean_force_g - 1) <= kMeanForce_g;
        known.push_back(means[i].mean(level ? dwells[i].kappa : 1, level));
    }
    Contradiction found;
    for (const auto& words : consistency(settings, known).contradictions) {
        if (found.first.empty()) found.first = words;
        found.warnings.push_back("configuration and recording do not fit: " + words);
    }
    if (found.first.empty()) return found;
    const auto list = suspects(settings, known);
    std::string named;
    for (const auto& suspect : list) named += (named.empty() ? "" : "; ") + suspect.words;
    if (const auto apart = told_apart_words(settings, list); !apart.empty()) named += "; " + apart;
    found.warnings.push_back(named.empty() ? "no single key explains it"
                                           : "suspects, best first: " + named);
    return found;
}

}  // namespace vibrig::estimator::commissioning
