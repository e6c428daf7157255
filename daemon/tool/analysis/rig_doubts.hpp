#pragma once

#include <string>
#include <vector>

#include "estimator/commissioning/consistency.hpp"
#include "estimator/identification/result.hpp"
#include "estimator/uncertainty/verdict.hpp"

namespace vibrig::tool {

/// Holds a recording against the configuration that it is identified with: gravity, Earth rate and
/// what 30 coefficients cannot explain (docs/commissioning.md).
class RigDoubts {
  public:
    explicit RigDoubts(const estimator::Settings& settings) : settings_(settings) {}

    void begin_dwell() { dwells_.emplace_back(); }
    void add(const estimator::Measurement& measurement) { dwells_.back().add(measurement); }
    /// Adds to the result's warnings. `rows`: of all dwells, those apart from the result's
    /// included. The first contradiction; empty: the configuration fits.
    [[nodiscard]] std::string tell(estimator::Result& result,
                                   const std::vector<estimator::DwellRow>& rows) const;

  private:
    estimator::Settings settings_;
    std::vector<estimator::commissioning::DwellMeans> dwells_;
};

/// Numbers of a rig that is not the configuration's are not valid, whatever their residuals.
/// `contradiction`: as tell() has it; empty changes nothing.
void contradict(estimator::uncertainty::Verdict& verdict, const std::string& contradiction);

}  // namespace vibrig::tool
