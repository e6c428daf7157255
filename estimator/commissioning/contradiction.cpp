#include "estimator/commissioning/contradiction.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "estimator/commissioning/consistency.hpp"
#include "estimator/commissioning/told_apart.hpp"
#include "estimator/filter/angles.hpp"

namespace vibrig::estimator::commissioning {

namespace {

/// As the filter: beyond it the level of a dwell is not known.
constexpr double kMeanForce_g = 0.02;

/// The columns that are in radians, as a table by anyone may have them; empty: none.
std::string in_radians(const Settings& settings, const std::vector<DwellMean>& dwells) {
    if (!(consistency(settings, dwells).gravity_deg > ConsistencyLimits{}.gravity_deg)) return {};
    // In radians a reading that jumps a whole turn is not unwrapped: its mean says nothing.
    constexpr double kJump_arcsec = 60;
    std::vector<DwellMean> taken = dwells;
    std::erase_if(taken, [](const DwellMean& dwell) {
        const double variance = std::ranges::max(dwell.slope_variance);
        return !(std::sqrt(variance) * dwell.duration_s < kJump_arcsec);
    });
    if (taken.empty()) return {};
    // All of them first: a table in radians is so as a whole.
    constexpr std::array kColumns{"alpha_deg, beta_deg, gamma_deg", "alpha_deg", "beta_deg",
                                  "gamma_deg"};
    for (std::size_t c = 0; c < kColumns.size(); ++c) {
        std::vector<DwellMean> converted = taken;
        for (DwellMean& dwell : converted) {
            for (std::size_t k = 0; k < 3; ++k)
                if (c == 0 || c == k + 1) dwell.encoder_rad[k] *= kDegPerRad;
            // Found with other attitudes, it is not known either.
            dwell.level_known = false;
        }
        if (consistency(settings, converted).contradictions.empty())
            return std::string(kColumns[c]) + ": in radians";
    }
    return {};
}

std::vector<DwellMean> known_of(const std::vector<DwellSummary>& dwells,
                                const std::vector<DwellMeans>& means) {
    std::vector<DwellMean> known;
    for (std::size_t i = 0; i < std::min(dwells.size(), means.size()); ++i) {
        if (!means[i].known()) continue;
        const bool level = std::abs(dwells[i].mean_force_g - 1) <= kMeanForce_g;
        known.push_back(means[i].mean(level ? dwells[i].kappa : 1, level));
    }
    return known;
}

}  // namespace

Contradiction contradiction_of(const Settings& settings, const std::vector<DwellSummary>& dwells,
                               const std::vector<DwellMeans>& means) {
    const std::vector<DwellMean> known = known_of(dwells, means);
    Contradiction found;
    for (const auto& words : consistency(settings, known).contradictions) {
        if (found.first.empty()) found.first = words;
        found.warnings.push_back("configuration and recording do not fit: " + words);
    }
    if (found.first.empty()) return found;
    const auto list = suspects(settings, known);
    std::string named = in_radians(settings, known);
    for (const auto& suspect : list) named += (named.empty() ? "" : "; ") + suspect.words;
    if (const auto apart = told_apart_words(settings, list); !apart.empty()) named += "; " + apart;
    found.warnings.push_back(named.empty() ? "no single key explains it"
                                           : "suspects, best first: " + named);
    return found;
}

std::string first_contradiction(const Settings& settings, const std::vector<DwellSummary>& dwells,
                                const std::vector<DwellMeans>& means) {
    const auto all = consistency(settings, known_of(dwells, means)).contradictions;
    return all.empty() ? "" : all.front();
}

}  // namespace vibrig::estimator::commissioning
