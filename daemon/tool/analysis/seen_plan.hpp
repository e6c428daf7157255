#pragma once

#include <memory>
#include <vector>

#include "estimator/identification/identification.hpp"
#include "estimator/identification/plan_report.hpp"

namespace vibrig::tool {

/// The plan that a recording followed, as its samples show it: where its dwells begin, and their
/// level by their own accelerometers. What it cannot determine is known without identifying.
class SeenPlan {
  public:
    explicit SeenPlan(const estimator::Settings& settings);
    ~SeenPlan();
    SeenPlan(const SeenPlan&) = delete;
    SeenPlan& operator=(const SeenPlan&) = delete;

    void begin_dwell(int run);
    void add(const estimator::Measurement& measurement);
    /// On standard error, each line beginning "before the run: ".
    void tell();

  private:
    class Dwell;
    void end_dwell();

    estimator::Settings settings_;
    std::unique_ptr<Dwell> dwell_;  ///< the present one
    int run_ = 0;
    std::vector<estimator::PlannedDwell> plan_;
    double period_s_ = 0;  ///< between samples; 0: not known
};

}  // namespace vibrig::tool
