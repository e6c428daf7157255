#pragma once

#include <string>
#include <vector>

#include "daemon/configuration/configuration.hpp"
#include "daemon/tool/design/plan_study.hpp"
#include "estimator/spectrum/mount.hpp"

namespace vibrig::tool::planner {

/// Sweeps in front of a plan: three positions, up and down (docs/spectrum.md, "Sweeps in a
/// campaign"). Throws std::runtime_error or plan::PlanError with the option, what was found and
/// what was expected.
class PlannedSweeps {
  public:
    /// `level_g`: peak at the platform that is asked for; positions as the encoders count, deg.
    PlannedSweeps(const PlanRequest& request, const configuration::Configuration& c,
                  const estimator::spectrum::Mount& mount, double level_g,
                  const std::vector<planning::Vec3>& positions_deg);

    /// Puts them in front of its runs, with what they take and what is said of them.
    void put_before(PlanStudy& study, const planning::Timing& timing) const;

  private:
    void check_range() const;
    void choose_level(double level_g);

    const SurveyRequest& asked_;
    const configuration::Configuration& c_;
    const estimator::spectrum::Mount& mount_;
    Sweeps planned_;
    std::vector<PlanRun> runs_;
    std::vector<std::string> warnings_;
};

}  // namespace vibrig::tool::planner
