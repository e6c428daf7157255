#include "daemon/tool/design/plan_study.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <stdexcept>

#include "daemon/tool/design/plan_terms.hpp"
#include "estimator/filter/encoder_angles.hpp"
#include "estimator/filter/parameters.hpp"
#include "estimator/identification/crlb.hpp"
#include "estimator/plan/augmentation.hpp"
#include "estimator/plan/exact.hpp"
#include "estimator/plan/optimum.hpp"
#include "estimator/spectrum/profile.hpp"

namespace vibrig::tool::planner {

namespace {

using planning::Vec3;

constexpr std::size_t kMostCandidates = 20'000;
constexpr double kSameLevel = 1e-9;
constexpr double kSameDirection = 1e-6;

bool counts_as_gimbals(const estimator::Settings& rig) {
    return rig.encoder_sign == std::array{1, 1, 1} &&
           rig.encoder_zero_deg == std::array{0.0, 0.0, 0.0};
}

/// Candidate or listed runs, with what the design algorithms need of each.
struct List {
    planning::Problem problem;
    std::vector<planning::Visit> visits;
};

class Study {
  public:
    explicit Study(const PlanRequest& request)
        : request_(request), c_(configuration::load(request.config, false).configuration) {
        timing_ = timing_of(request, c_);
        limits_ = request.limits;
        for (std::size_t k = 0; k < 3; ++k) {
            if (request.limited[k]) continue;
            limits_.low[k] = c_.gimbal.travel_deg[k][0];
            limits_.high[k] = c_.gimbal.travel_deg[k][1];
        }
        if (!request.forbidden.empty()) limits_.forbidden = positions_in(request.forbidden);
        terms_ = terms_without(request.without);
        if (request.config.empty() && !request.evaluate.empty()) take_mount_of_plan();
        out_.transmission = c_.estimator.transmission;
        out_.frequency_hz = c_.estimator.frequency_hz;
        out_.dwell_s = timing_.dwell_s;
        out_.rig = c_.estimator;
    }

    PlanStudy run() {
        if (!request_.positions.empty()) {
            listed_ = positions_in(request_.positions);
            for (const Vec3& p : listed_) {
                if (!limits_.allow(p)) {
                    throw std::runtime_error(
                        request_.positions +
                        printed(": found (%.6g, %.6g, %.6g) deg, expected positions within the "
                                "limits",
                                p[0], p[1], p[2]));
                }
            }
        }
        choose_levels();
        make_candidates();
        if (!listed_.empty())
            out_.vertical_axes = planning::vertical_axes(c_.estimator, listed_, levels_);
        find_runs();
        put_in_order();
        judge();
        if (!swept_.empty()) put_sweeps_before(out_, swept_, timing_, c_.campaign.swept_by);
        return std::move(out_);
    }

  private:
    /// No configuration says what stands between table and platform: then the plan may.
    void take_mount_of_plan() {
        const auto said = plan::read_plan_mount(request_.evaluate);
        if (!said) return;
        auto& mount = c_.spectrum.mount;
        auto& reference = c_.estimator.transmission;
        const double at_hz = said->at_hz > 0 ? said->at_hz : c_.estimator.frequency_hz;
        mount = {said->transmission >= 1 && said->at_hz == 0, {}, {}};
        if (!mount.hard)
            mount.pads = estimator::spectrum::pads_with(at_hz, std::min(said->transmission, 0.999),
                                                        c_.spectrum.pads_damping);
        reference = said->at_hz > 0
                        ? mount.transmission(c_.estimator.frequency_hz).value_or(reference)
                        : said->transmission;
    }
    [[nodiscard]] std::vector<Vec3> positions_in(const std::string& path) {
        auto positions = plan::read_positions(path, out_.warnings);
        for (Vec3& position : positions) position = to_readings(c_.estimator, position);
        return positions;
    }
    [[nodiscard]] std::vector<plan::PlannedRun> plan_in(const std::string& path) {
        const auto transmission = [this](std::optional<double> hz) {
            return hz ? c_.spectrum.mount.transmission(*hz)
                      : std::optional(c_.estimator.transmission);
        };
        auto [runs, dwell_s, warning] =
            plan::read_plan_file(path, transmission, c_.estimator.frequency_hz);
        if (!warning.empty()) out_.warnings.push_back(warning);
        plan::refuse_random(runs);
        for (auto& run : runs) run.position_deg = to_readings(c_.estimator, run.position_deg);
        return runs;
    }
    /// Sweeps are no rows: they are set aside, and stand in front of what is judged.
    void set_aside_sweeps() {
        std::erase_if(given_, [this](const plan::PlannedRun& run) {
            if (!(run.sweep_to_hz > 0)) return false;
            PlanRun sweep{{run.position_deg, run.level_g}, run.table_g, 1};
            sweep.sweep = {run.sweep_from_hz, run.sweep_to_hz, run.sweep_s};
            swept_.insert(swept_.end(), run.count, sweep);
            return true;
        });
    }

    [[nodiscard]] bool designs() const {
        return request_.evaluate.empty() && request_.given.empty() &&
               (listed_.empty() || request_.runs > 0 || by_targets());
    }
    [[nodiscard]] bool by_targets() const { return !request_.targets.empty(); }

    void choose_levels() {
        levels_ = request_.levels_g;
        if (!request_.given.empty()) levels_.clear();
        for (const PlanRun& run : request_.given) levels_.push_back(run.visit.level_g);
        if (!request_.evaluate.empty()) {
            given_ = plan_in(request_.evaluate);
            set_aside_sweeps();
            if (given_.empty())
                throw std::runtime_error(request_.evaluate +
                                         ": found sweeps alone, expected dwells beside them");
            if (levels_.empty()) {
                for (const auto& run : given_) levels_.push_back(run.level_g);
            }
        }
        if (levels_.empty() && designs()) levels_ = {0, 2, 4, 4.667, 6};
        if (levels_.empty()) {
            for (const double g : c_.campaign.table_g)
                levels_.push_back(g * c_.estimator.transmission);
        }
        std::sort(levels_.begin(), levels_.end());
        levels_.erase(std::unique(levels_.begin(), levels_.end(),
                                  [](double a, double b) { return std::abs(a - b) < kSameLevel; }),
                      levels_.end());
        if (!request_.given.empty()) return;
        const bool one_frequency = std::all_of(
            given_.begin(), given_.end(), [](const auto& run) { return run.frequency_hz == 0; });
        for (const double level : levels_) {
            if (one_frequency)
                check_level(level, level / c_.estimator.transmission, c_.estimator.frequency_hz);
        }
        for (const auto& run : given_) {
            if (!one_frequency)
                check_level(run.level_g, run.table_g,
                            run.frequency_hz > 0 ? run.frequency_hz : c_.estimator.frequency_hz);
        }
    }

    /// Against the shaker's limits at the table.
    void check_level(double level, double table, double hz) {
        const double omega = 2 * std::numbers::pi * hz;
        const double mps2 = table * c_.estimator.gravity_mps2;
        const auto check = [&](double value, double limit, const char* unit, const char* key) {
            if (value <= limit * (1 + 1e-9)) return;
            const std::string message = printed(
                "%.6g g at the platform is %.6g g at the table, %.6g %s peak: more than "
                "%.6g %s (%s)",
                level, table, value, unit, limit, unit, key);
            if (!request_.config.empty())
                throw std::runtime_error(
                    "levels: found " + message +
                    printed(", expected at most %.4g g at the platform: --levels",
                            std::floor(1e3 * level * limit / value) / 1e3));
            out_.warnings.push_back(message);
            out_.beyond_limits = true;
        };
        check(table, c_.campaign.max_acceleration_g, "g", "shaker.limits.acceleration_g");
        check(mps2 / omega, c_.campaign.max_velocity_mps, "m/s", "shaker.limits.velocity_mps");
        check(1e3 * mps2 / (omega * omega), c_.campaign.max_displacement_mm, "mm",
              "shaker.limits.displacement_mm");
    }

    [[nodiscard]] planning::Point point(const planning::Visit& visit) const {
        planning::Point point;
        point.f = planning::vibration_row(planning::up_at(c_.estimator, visit.position_deg),
                                          visit.level_g);
        point.noise = std::hypot(1.0, request_.noise_per_g * visit.level_g);
        if (request_.time_costs) {
            const double rest = timing_.dwell_s + timing_.settle_s;
            point.cost = visit.level_g > 0 ? 1 + 2 * timing_.ramp_s / rest : 1;
        }
        return point;
    }

    void make_candidates() {
        std::vector<Vec3> positions = listed_;
        if (positions.empty() && request_.grid_deg > 0) {
            positions = planning::position_grid(c_.estimator, request_.grid_deg, limits_);
        } else if (positions.empty()) {
            for (const Vec3& direction : planning::cube_directions()) {
                if (const auto p = planning::position_for(c_.estimator, direction, limits_)) {
                    positions.push_back(*p);
                }
            }
        }
        if (positions.empty()) {
            throw std::runtime_error(
                "the gimbal limits leave no position, expected some to choose from");
        }
        if (positions.size() * levels_.size() > kMostCandidates) {
            throw std::runtime_error("found " + std::to_string(positions.size()) +
                                     " positions at " + std::to_string(levels_.size()) +
                                     " levels, expected " + std::to_string(kMostCandidates) +
                                     " combinations at most: a wider grid");
        }
        candidates_.problem.terms = terms_;
        for (const double level : levels_) {
            for (const Vec3& position : positions) {
                const planning::Visit visit{position, level};
                candidates_.visits.push_back(visit);
                candidates_.problem.points.push_back(point(visit));
            }
        }
    }

    void find_runs() {
        if (!request_.given.empty()) {
            out_.runs = request_.given;
            return;
        }
        if (!given_.empty()) {
            for (const auto& run : given_)
                out_.runs.push_back({{run.position_deg, run.level_g},
                                     run.table_g,
                                     run.count,
                                     run.frequency_hz,
                                     run.verify});
            return;
        }
        const bool possible = planning::evaluate(candidates_.problem,
                                                 planning::Effort(candidates_.problem.size(), 1.0))
                                  .identifies_all();
        planning::Counts counts(candidates_.visits.size(), 1);
        if (designs() && possible) {
            counts = by_targets()
                         ? for_targets()
                         : planning::exact_design(candidates_.problem,
                                                  request_.runs > 0 ? request_.runs : kDefaultRuns,
                                                  {0, request_.seed, done()});
        }
        for (std::size_t i = 0; i < counts.size(); ++i) {
            if (counts[i] > 0)
                take(candidates_.visits[i], table_of(candidates_.visits[i].level_g), counts[i]);
        }
    }

    [[nodiscard]] double table_of(double level) const { return level / c_.estimator.transmission; }

    void take(const planning::Visit& visit, double table_g, std::size_t count) {
        out_.runs.push_back({visit, table_g, count, 0, false});
    }

    /// What is measured already, as effort at candidates that are added for it.
    planning::Effort done() {
        if (request_.done.empty()) return {};
        planning::Effort effort(candidates_.visits.size(), 0.0);
        for (const auto& run : plan_in(request_.done)) {
            if (run.sweep_to_hz > 0 || run.verify) continue;
            const planning::Point wanted = point({run.position_deg, run.level_g});
            std::size_t at = 0;
            for (; at < candidates_.problem.size(); ++at) {
                double away = 0;
                for (std::size_t k = 0; k < planning::kTerms; ++k)
                    away =
                        std::max(away, std::abs(candidates_.problem.points[at].f[k] - wanted.f[k]));
                if (away < kSameDirection) break;
            }
            if (at == candidates_.problem.size()) {
                throw std::runtime_error(request_.done +
                                         printed(": found a run at (%.6g, %.6g, %.6g) deg, %.6g g, "
                                                 "expected candidates of this plan (--positions, "
                                                 "--levels)",
                                                 run.position_deg[0], run.position_deg[1],
                                                 run.position_deg[2], run.level_g));
            }
            effort[at] += static_cast<double>(run.count);
        }
        return effort;
    }

    planning::Counts for_targets() {
        std::vector<double> target;
        for (std::size_t i = 0; i < estimator::kParameters; ++i) {
            const std::string unit = estimator::parameter_unit(i);
            target.push_back(request_.targets[unit == "deg/h" ? 0 : unit == "deg/h/g" ? 1 : 2]);
        }
        const auto experiment = [&](const planning::Visit& visit) {
            planning::Experiment e;
            e.rows = estimator::rate_rows(c_.estimator,
                                          {estimator::gimbal_deg(c_.estimator, visit.position_deg),
                                           planning::kappa_of(visit.level_g), timing_.dwell_s},
                                          {}, period_of(c_));
            const double noise = std::hypot(1.0, request_.noise_per_g * visit.level_g);
            for (double& x : e.rows) x /= noise;
            e.cost = point(visit).cost;
            return e;
        };
        std::vector<planning::Experiment> experiments;
        for (const auto& visit : candidates_.visits) experiments.push_back(experiment(visit));
        planning::Effort effort = done();
        effort.resize(candidates_.visits.size(), 0.0);
        const std::size_t at_most = request_.runs > 0 ? request_.runs : kMostForTargets;
        planning::Counts counts(candidates_.visits.size(), 0);
        add_for(target, experiments, effort, at_most, counts);
        // A target of 0 asks for nothing, and the prior is no measurement: then the runs that
        // determine everything come first.
        const std::size_t lacking = rank_lacking(effort, {});
        if (rank_lacking(effort, counts) == 0 || lacking > at_most) return counts;
        counts = planning::exact_design(candidates_.problem, lacking, {0, request_.seed, effort});
        add_for(target, experiments, effort, at_most - lacking, counts);
        return counts;
    }

    /// Those that are missed by the runs done already and those of `counts`, `at_most` more.
    void add_for(const std::vector<double>& target,
                 const std::vector<planning::Experiment>& experiments, planning::Effort effort,
                 std::size_t at_most, planning::Counts& counts) {
        for (std::size_t i = 0; i < counts.size(); ++i) effort[i] += static_cast<double>(counts[i]);
        const auto found =
            planning::augment(planning::covariance_after(prior_of_all(), experiments, effort),
                              experiments, target, at_most);
        for (const std::size_t i : found.runs) ++counts[i];
        out_.refusal.clear();
        if (found.met) return;
        std::size_t all = 0;
        for (const std::size_t count : counts) all += count;
        out_.refusal = "the targets are not met with " + std::to_string(all) +
                       " runs, expected more runs or wider targets";
    }

    [[nodiscard]] std::size_t rank_lacking(planning::Effort effort,
                                           const planning::Counts& counts) const {
        for (std::size_t i = 0; i < counts.size(); ++i) effort[i] += static_cast<double>(counts[i]);
        const auto evaluation = planning::evaluate(candidates_.problem, effort);
        return evaluation.coefficients - evaluation.rank;
    }

    [[nodiscard]] std::vector<double> prior_of_all() const {
        const auto prior = estimator::prior_sigma(c_.estimator);
        std::vector<double> sigma;
        for (std::size_t i = 0; i < estimator::kParameters; ++i)
            sigma.push_back(prior[estimator::internal_of(i)]);
        return sigma;
    }

    void put_in_order() {
        std::vector<planning::Visit> visits;
        std::vector<planning::Row> regressors;
        std::vector<PlanRun> single;
        for (const PlanRun& run : out_.runs) {
            for (std::size_t k = 0; k < run.count; ++k) {
                visits.push_back(run.visit);
                regressors.push_back(point(run.visit).f);
                single.push_back({run.visit, run.table_g, 1, run.frequency_hz, run.verify});
            }
        }
        planning::Order order(visits.size());
        for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
        const bool as_listed = request_.order == "list" || !request_.given.empty() ||
                               (!designs() && !request_.ordered);
        if (!as_listed && request_.order == "travel") {
            order = planning::shortest_travel(visits, timing_);
        } else if (!as_listed && request_.order == "balanced") {
            order = estimator::uncertainty::balanced_order(
                visits, regressors, timing_,
                estimator::rate_variance(c_.estimator, timing_.dwell_s, period_of(c_)));
        } else if (!as_listed) {
            order = planning::randomised(regressors, std::max<std::size_t>(request_.block, 1),
                                         request_.seed);
        }
        out_.duration = planning::duration(visits, order, timing_);
        out_.drift_imbalance = planning::drift_imbalance(regressors, order);
        if (as_listed) return;
        out_.runs.clear();
        for (const std::size_t i : order) {
            PlanRun& run = single[i];
            const bool again = !out_.runs.empty() &&
                               out_.runs.back().visit.position_deg == run.visit.position_deg &&
                               out_.runs.back().visit.level_g == run.visit.level_g &&
                               out_.runs.back().frequency_hz == run.frequency_hz &&
                               out_.runs.back().verify == run.verify;
            if (again) {
                ++out_.runs.back().count;
            } else {
                out_.runs.push_back(run);
            }
        }
    }

    /// With what is declared, and of the order: a step that it cannot tell from the coefficients.
    void judge_uncertainty() {
        constexpr double kMostStep = 10;
        std::vector<planning::Visit> visits;
        // In the order in which they were done: a drift is told from coefficients by it.
        if (!request_.done.empty()) {
            for (const auto& run : plan_in(request_.done))
                if (!(run.sweep_to_hz > 0) && !run.verify)
                    visits.insert(visits.end(), run.count, {run.position_deg, run.level_g});
        }
        for (const PlanRun& run : out_.runs)
            if (!run.verify) visits.insert(visits.end(), run.count, run.visit);
        if (visits.size() < 2 || terms_ != planning::kAllTerms) return;
        out_.uncertainty = plan_uncertainty(c_.estimator, visits, timing_, period_of(c_));
        if (out_.uncertainty->merit.step > kMostStep)
            out_.warnings.push_back(
                printed("in this order one step of a bias makes a standard error %.3g times as "
                        "large: --order balanced",
                        out_.uncertainty->merit.step));
    }

    void judge() {
        // Candidates and the plan's own runs in one problem, so that the bound covers both.
        planning::Problem all = candidates_.problem;
        planning::Effort effort(all.size(), 0.0);
        std::vector<plan::PlannedRun> planned;
        for (const PlanRun& run : out_.runs) {
            all.points.push_back(point(run.visit));
            // What is held out tells of no coefficient.
            effort.push_back(run.verify ? 0.0 : static_cast<double>(run.count));
            planned.push_back({run.visit.position_deg, run.visit.level_g, run.table_g, run.count,
                               run.frequency_hz, run.verify});
        }
        if (!request_.done.empty()) {
            const planning::Effort before = done();
            for (std::size_t i = 0; i < before.size(); ++i) {
                effort[i] += before[i];
                if (before[i] > 0)
                    planned.push_back({candidates_.visits[i].position_deg,
                                       candidates_.visits[i].level_g,
                                       table_of(candidates_.visits[i].level_g),
                                       static_cast<std::size_t>(before[i]), 0, false});
            }
        }
        out_.evaluation = planning::evaluate(all, effort);
        out_.forecast =
            plan::forecast(c_.estimator, planned, timing_.dwell_s, period_of(c_), terms_);
        if (request_.noise_per_g > 0) {
            out_.warnings.emplace_back(
                "the standard errors of the 30 coefficients are without --noise-per-g");
        }
        if (!out_.evaluation.identifies_all()) {
            out_.refusal = out_.forecast.refusal;
            return;
        }
        if (!out_.forecast.warning.empty()) out_.warnings.push_back(out_.forecast.warning);
        judge_uncertainty();
        out_.bound = planning::equivalence_bound(all, effort);
        const planning::Problem& over = candidates_.problem;
        if (!planning::evaluate(over, planning::Effort(over.size(), 1.0)).identifies_all()) {
            out_.warnings.emplace_back(
                "the candidates alone do not determine everything: efficiencies are against the "
                "plan's own runs");
            compare(all);
        } else {
            compare(over);
        }
    }

    void compare(const planning::Problem& over) {
        const planning::Optimum best = planning::d_optimum(over);
        out_.d_efficiency = planning::d_efficiency(out_.evaluation, best.log_det);
        out_.optimum_gap = best.gap;
        out_.a_efficiency = planning::a_optimum(over).value / out_.evaluation.trace;
        out_.e_efficiency = planning::e_optimum(over).lower_bound / out_.evaluation.largest;
        std::map<double, double> shares;
        for (std::size_t i = 0; i < candidates_.visits.size() && i < best.share.size(); ++i) {
            shares[candidates_.visits[i].level_g] += best.share[i];
        }
        out_.optimal_shares.assign(shares.begin(), shares.end());
    }

    static constexpr std::size_t kMostForTargets = 200;

    const PlanRequest& request_;
    configuration::Configuration c_;
    planning::Timing timing_;
    planning::GimbalLimits limits_;
    planning::Terms terms_ = planning::kAllTerms;
    std::vector<Vec3> listed_;
    std::vector<double> levels_;
    std::vector<plan::PlannedRun> given_;
    std::vector<PlanRun> swept_;
    List candidates_;
    PlanStudy out_;
};

}  // namespace

Vec3 to_readings(const estimator::Settings& rig, const Vec3& at) {
    return counts_as_gimbals(rig) ? at : planning::position_of(rig, at);
}

Vec3 to_attitude(const estimator::Settings& rig, const Vec3& at) {
    return counts_as_gimbals(rig) ? at : planning::attitude_of(rig, at);
}

planning::Timing timing_of(const PlanRequest& request, const configuration::Configuration& c) {
    return {request.dwell_s.value_or(c.campaign.dwell_s),
            request.settle_s.value_or(c.campaign.settle_s),
            request.ramp_s.value_or(c.campaign.ramp_s), request.slew_deg_per_s};
}

PlanStudy study(const PlanRequest& request) { return Study(request).run(); }

estimator::Settings frame_of(const PlanRequest& request) {
    return configuration::load(request.config, false).configuration.estimator;
}

}  // namespace vibrig::tool::planner
