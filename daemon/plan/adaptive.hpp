#pragma once

#include <array>
#include <string>
#include <vector>

#include "daemon/plan/plan_file.hpp"
#include "estimator/filter/settings.hpp"
#include "estimator/identification/result.hpp"
#include "estimator/plan/augmentation.hpp"
#include "estimator/plan/order.hpp"
#include "estimator/plan/positions.hpp"

namespace vibrig::plan {

namespace planning = estimator::plan;

struct AdaptiveSettings {
    std::vector<double> table_g;     ///< levels to choose from, peak at the table
    std::array<double, 3> target{};  ///< sigma of bias, linear, quadratic terms; 0: any
    planning::Timing timing;         ///< of one dwell
    double levelling_s = 0;          ///< before each dwell
    double closing_s = 0;            ///< after the last dwell, within the limit, too
    double time_limit_s = 0;         ///< 0: none
    double period_s = 0;             ///< between samples; required
    planning::GimbalLimits limits;   ///< readings
};

/// From fewer nobody can tell what the bias did.
inline constexpr std::size_t kFewestDwells = 14;

/// The filter's covariance (30 x 30, row-major) with each standard error as large as u_a, where the
/// dwells of the result say that noise is not all: scatter, walk or steps of the bias.
[[nodiscard]] std::vector<double> widened(std::vector<double> covariance,
                                          const estimator::Settings& settings,
                                          const estimator::Result& result);

/// Chooses a campaign's dwells one by one from a covariance: the cheapest plan that still brings
/// every coefficient to its target, of which the most informative dwell is done next. Candidates
/// are the 26 directions of the cube at every level.
class AdaptivePlan {
  public:
    /// Throws std::runtime_error if the levels cannot determine all coefficients or no target is
    /// set.
    AdaptivePlan(const estimator::Settings& settings, const AdaptiveSettings& adaptive);

    enum class Verdict : unsigned char { go_on, targets_met, time_limit };
    struct Decision {
        Verdict verdict = Verdict::go_on;
        PlannedRun run;        ///< next, if it goes on
        std::size_t left = 0;  ///< dwells to be expected, the next included
        double left_s = 0;
        std::string words;  ///< for the log
    };

    /// `covariance` 30 x 30, row-major, order of parameter_names(); `here` the present gimbal
    /// angles; `dwells` kept so far. Takes some tenths of a second: not for a thread that must
    /// answer at once.
    [[nodiscard]] Decision next(const std::vector<double>& covariance,
                                const std::array<double, 3>& here_deg, double elapsed_s,
                                std::size_t dwells = kFewestDwells) const;

    /// Before anything is measured, with the prior of the settings.
    [[nodiscard]] Decision outlook() const;

  private:
    [[nodiscard]] double time_of(const PlannedRun& run,
                                 const std::array<double, 3>& here_deg) const;

    AdaptiveSettings adaptive_;
    std::vector<PlannedRun> candidates_;
    std::vector<planning::Experiment> experiments_;
    std::vector<double> target_, prior_;
};

}  // namespace vibrig::plan
