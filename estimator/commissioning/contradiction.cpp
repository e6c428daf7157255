#include "estimator/commissioning/contradiction.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/commissioning/consistency.hpp"
#include "estimator/commissioning/told_apart.hpp"
#include "estimator/filter/angles.hpp"

namespace vibrig::estimator::commissioning {

namespace {

/// As the filter: beyond it the level of a dwell is not known.
constexpr double kMeanForce_g = 0.02;

/// Whether gravity fits once readings in degrees are taken for radians, as a table by anyone may
/// have them.
bool in_radians(const Settings& settings, const std::vector<DwellMean>& dwells) {
    // In radians a reading that jumps a whole turn is not unwrapped: its mean says nothing.
    constexpr double kJump_arcsec = 60;
    std::vector<DwellMean> taken;
    for (DwellMean dwell : dwells) {
        const double variance = std::ranges::max(dwell.slope_variance);
        if (!(std::sqrt(variance) * dwell.duration_s < kJump_arcsec)) continue;
        for (double& angle : dwell.encoder_rad) angle *= kDegPerRad;
        // Found with other attitudes, it is not known either.
        dwell.level_known = false;
        taken.push_back(dwell);
    }
    return !taken.empty() && consistency(settings, taken).contradictions.empty() &&
           consistency(settings, dwells).gravity_deg > ConsistencyLimits{}.gravity_deg;
}

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
    std::string named =
        in_radians(settings, known) ? "alpha_deg, beta_deg, gamma_deg: in radians" : "";
    for (const auto& suspect : list) named += (named.empty() ? "" : "; ") + suspect.words;
    if (const auto apart = told_apart_words(settings, list); !apart.empty()) named += "; " + apart;
    found.warnings.push_back(named.empty() ? "no single key explains it"
                                           : "suspects, best first: " + named);
    return found;
}

}  // namespace vibrig::estimator::commissioning
