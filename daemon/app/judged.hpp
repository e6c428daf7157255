#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/domain/events.hpp"
#include "daemon/dwells/live.hpp"
#include "daemon/results/spectrum_result.hpp"
#include "daemon/status/status.hpp"
#include "estimator/identification/dwell_means.hpp"
#include "estimator/identification/result.hpp"
#include "estimator/uncertainty/assessment.hpp"

namespace vibrig {

/// What is to be made of the dwells at the end: they are in the journal.
struct Again {
    noise::Found found;
    std::string journal;
    std::uint64_t configuration_hash = 0;
};

/// What can be believed of the dwells, or of the same identified anew.
struct Judged {
    estimator::uncertainty::Assessment assessed;
    std::optional<estimator::Result> anew;
    std::shared_ptr<const dwells::Live> live;           ///< what `anew` replaces
    std::string not_anew;                               ///< why not, though it should be
    std::optional<tool::SpectrumResult> spectrum = {};  ///< of several frequencies, in the end
    /// How the dwells contradict the configuration, and last what would explain it.
    std::vector<std::string> contradictions = {};
    std::shared_ptr<const std::vector<VerdictStatus::Combination>> combinations = {};
};

/// Any thread. `all_rows`: with those apart from the result's; `means`: of the result's dwells.
[[nodiscard]] Judged judge(const estimator::Settings& settings, const estimator::Result& result,
                           const std::optional<Again>& again, estimator::uncertainty::Stage stage,
                           const std::vector<estimator::DwellRow>& all_rows,
                           const std::vector<estimator::DwellMeans>& means,
                           estimator::spectrum::Shaken shaken);

[[nodiscard]] Severity severity_of(estimator::uncertainty::Level level);

}  // namespace vibrig
