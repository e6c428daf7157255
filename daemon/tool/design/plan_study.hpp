#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "daemon/configuration/configuration.hpp"
#include "daemon/plan/forecast.hpp"
#include "daemon/plan/plan_file.hpp"
#include "daemon/results/text_line.hpp"
#include "estimator/plan/evaluation.hpp"
#include "estimator/plan/order.hpp"
#include "estimator/plan/positions.hpp"
#include "estimator/plan/vertical_axes.hpp"
#include "estimator/spectrum/about.hpp"
#include "estimator/spectrum/survey.hpp"
#include "estimator/spectrum/sweep_bounds.hpp"
#include "estimator/spectrum/sweep_plan.hpp"
#include "estimator/uncertainty/assessment.hpp"
#include "estimator/uncertainty/balanced_order.hpp"

namespace vibrig::tool::planner {

namespace planning = estimator::plan;

/// What `vibrig plan` is asked.
struct SurveyRequest {
    std::vector<double> frequencies;  ///< Hz
    double highest_hz = 0;            ///< 0: the highest listed one, or the profile's
    std::string mount;                ///< "isolated", "hard"; empty: the configuration's
    std::string profile;              ///< file or name; empty: none
    std::vector<std::string> attitudes;
    std::vector<double> sweeps;  ///< Hz, lowest and highest; empty: no sweeps
    double sweep_s = 300;
    std::string about;  ///< result file whose resonances are looked at; empty: none

    [[nodiscard]] bool asked() const {
        return !frequencies.empty() || highest_hz > 0 || !profile.empty() || !sweeps.empty() ||
               !about.empty();
    }
};

struct PlanRun;

struct PlanRequest {
    std::string positions;             ///< file; empty: the 26 directions of the cube
    std::vector<double> levels_g;      ///< at the platform; empty: see levels()
    std::size_t runs = 0;              ///< 0: with `positions` that list, else kDefaultRuns
    std::string evaluate;              ///< plan file; empty: make one
    std::string done;                  ///< plan file of what is measured already
    std::string config;                ///< empty: defaults
    std::vector<double> targets;       ///< standard errors of bias, linear, quadratic terms
    std::vector<std::string> without;  ///< terms the model has not
    double grid_deg = 0;               ///< candidates every so many deg; 0: the 26 directions
    planning::GimbalLimits limits;
    std::array<bool, 3> limited{};  ///< by `limits`; else by the configuration's travel
    std::string forbidden;          ///< file of positions
    double noise_per_g = 0;         ///< noise is hypot(1, this times the level)
    bool time_costs = false;        ///< compare per time instead of per run
    std::optional<double> dwell_s, settle_s, ramp_s;
    double slew_deg_per_s = 5;
    std::string order = "travel";  ///< "travel", "balanced", "random", "list"
    bool ordered = false;          ///< somebody asked for it: what is judged is put in it, too
    std::size_t block = 8;
    std::uint64_t seed = 1;
    SurveyRequest survey;
    std::vector<PlanRun> given;  ///< runs made elsewhere, in their order
};

inline constexpr std::size_t kDefaultRuns = 14;

struct PlanRun {
    planning::Visit visit;
    double table_g = 0;
    std::size_t count = 1;
    double frequency_hz = 0;  ///< 0: the configuration's
    bool verify = false;      ///< held out of the fit
    estimator::SweptSine
        sweep{};  ///< in place of the frequency; the visit's level: where it begins
};

/// What is said of a plan over frequency besides.
struct Survey {
    bool hard = false;
    std::vector<estimator::spectrum::SurveyLine> lines;
    std::vector<std::size_t> dwells;                       ///< of each line
    std::vector<std::pair<double, double>> smallest_seen;  ///< resonance, Hz, and share
    double highest_hz = 0;                                 ///< that a flat verdict reaches to
    std::optional<double> predicted_u_deg_h;               ///< of the profile's drift
    std::string profile;
    std::vector<estimator::spectrum::About> about;
};

/// What is said of sweeps in front of it.
struct Sweeps {
    double from_hz = 0, to_hz = 0, seconds = 0;  ///< upwards
    double table_g = 0;
    double lowest_g = 0, highest_g = 0;  ///< at the platform, along them
    estimator::spectrum::UsableBlocks up, down;
    std::array<double, 6> seen{};  ///< estimator::spectrum::products_seen()
};

/// What a plan allows with the inputs as they are declared, before anything is shaken.
struct PlanUncertainty {
    estimator::uncertainty::Assessment assessed;  ///< without noise, typical coefficients
    estimator::uncertainty::OrderMerit merit;
};

struct PlanStudy {
    std::vector<PlanRun> runs;        ///< in the order they are to be run
    planning::Evaluation evaluation;  ///< unit noise
    double d_efficiency = 0, bound = 0, a_efficiency = 0;
    double e_efficiency = 0;  ///< at least
    double optimum_gap = 0;   ///< max d - p of the optimum compared with
    std::vector<std::pair<double, double>> optimal_shares;  ///< of the levels
    plan::Forecast forecast;
    planning::Duration duration;
    double drift_imbalance = 0;
    std::optional<PlanUncertainty> uncertainty;         ///< of a plan that determines everything
    std::vector<planning::VerticalAxis> vertical_axes;  ///< if a position list was given
    std::vector<std::string> warnings;
    bool beyond_limits = false;  ///< a level asks for more than the shaker's limits
    std::string refusal;         ///< empty: the plan determines everything
    std::optional<Survey> survey;
    std::optional<Sweeps> sweeps;
    double transmission = 0, frequency_hz = 0, dwell_s = 0;
    estimator::Settings rig;
};

/// Files and people have gimbal angles, a visit has what the encoders show; deg.
[[nodiscard]] planning::Vec3 to_readings(const estimator::Settings& rig, const planning::Vec3& at);
[[nodiscard]] planning::Vec3 to_attitude(const estimator::Settings& rig, const planning::Vec3& at);

/// Times of one dwell, by the request or else the configuration.
[[nodiscard]] planning::Timing timing_of(const PlanRequest& request,
                                         const configuration::Configuration& c);
/// `visits` in their order, levels at the platform; `period_s` between samples. Coefficients as
/// those of Table 2 of Tang et al. 2009: 1 deg/h, 1 deg/h/g, 0.03 deg/h/g^2.
[[nodiscard]] PlanUncertainty plan_uncertainty(const estimator::Settings& settings,
                                               const std::vector<planning::Visit>& visits,
                                               const planning::Timing& timing, double period_s);
/// Between samples, s.
[[nodiscard]] inline double period_of(const configuration::Configuration& c) {
    return static_cast<double>(c.assembler.sample_period) * 1e-9;
}

/// Throws std::runtime_error for bad input.
[[nodiscard]] PlanStudy study(const PlanRequest& request);

/// Runs that sweep, in front of its runs, with the time that they take.
void put_sweeps_before(PlanStudy& study, const std::vector<PlanRun>& sweeps,
                       const planning::Timing& timing, const estimator::spectrum::SweptBy& by);
/// A plan over frequency: see SurveyRequest. Throws std::runtime_error for bad input.
[[nodiscard]] PlanStudy survey_study(const PlanRequest& request);

[[nodiscard]] std::string plan_json(const PlanStudy& study);
[[nodiscard]] std::string plan_table(const PlanStudy& study);
/// The directions of the vertical on both hemispheres, SVG.
[[nodiscard]] std::string plan_picture(const PlanStudy& study, const estimator::Settings& frame);
/// The rig's, of a request's configuration.
[[nodiscard]] estimator::Settings frame_of(const PlanRequest& request);

}  // namespace vibrig::tool::planner
