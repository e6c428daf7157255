#include "daemon/plan/adaptive.hpp"

#include <algorithm>
#include <cmath>

#include "daemon/plan/forecast.hpp"
#include "estimator/filter/encoder_angles.hpp"
#include "estimator/filter/parameters.hpp"
#include "estimator/identification/crlb.hpp"
#include "estimator/plan/positions.hpp"
#include "estimator/uncertainty/assessment.hpp"
#include "proto/printed.hpp"

namespace vibrig::plan {

namespace {

/// A plan that needs more is not foreseen to its end.
constexpr std::size_t kFarthest = 60;
// Targets come nearer by a fifth at a time, down to 1e-5 of them.
constexpr int kNearest = 50;

constexpr std::array<const char*, 3> kKinds{"bias", "linear", "quadratic"};

}  // namespace

std::vector<double> widened(std::vector<double> covariance, const estimator::Settings& settings,
                            const estimator::Result& result) {
    if (result.rows.size() < kFewestDwells) return covariance;
    const auto assessed = estimator::uncertainty::assess(settings, result);
    std::array<double, estimator::kParameters> factor{};
    for (std::size_t i = 0; i < factor.size(); ++i) {
        const auto& c = assessed.coefficients[i];
        factor[i] = c.u_a > c.sigma ? c.u_a / c.sigma : 1;
    }
    for (std::size_t i = 0; i < factor.size(); ++i) {
        for (std::size_t j = 0; j < factor.size(); ++j)
            covariance[i * factor.size() + j] *= factor[i] * factor[j];
    }
    return covariance;
}

AdaptivePlan::AdaptivePlan(const estimator::Settings& settings, const AdaptiveSettings& adaptive)
    : adaptive_(adaptive) {
    if (!(*std::max_element(adaptive.target.begin(), adaptive.target.end()) > 0)) {
        throw std::runtime_error(
            "found an adaptive campaign without targets, expected one at least");
    }
    const double dwell_s = adaptive.timing.dwell_s;
    for (const double table_g : adaptive.table_g) {
        for (const auto& direction : planning::cube_directions()) {
            const auto position = planning::position_for(settings, direction, adaptive.limits);
            if (!position) continue;
            const PlannedRun run{*position, table_g * settings.transmission, table_g, 1};
            candidates_.push_back(run);
            experiments_.push_back(
                {estimator::rate_rows(settings,
                                      {estimator::gimbal_deg(settings, *position),
                                       planning::kappa_of(run.level_g), dwell_s},
                                      {}, adaptive.period_s),
                 time_of(run, *position)});
        }
    }
    const Forecast all = forecast(settings, candidates_, dwell_s, adaptive.period_s);
    if (!all.identifies_all) throw std::runtime_error("adaptive campaign: " + all.refusal);
    const auto prior = estimator::prior_sigma(settings);
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        target_.push_back(adaptive.target[estimator::order_of(i)]);
        prior_.push_back(prior[estimator::internal_of(i)]);
    }
}

double AdaptivePlan::time_of(const PlannedRun& run, const std::array<double, 3>& here_deg) const {
    return planning::slew_s(here_deg, run.position_deg, adaptive_.timing) + adaptive_.levelling_s +
           adaptive_.timing.look_s + adaptive_.timing.settle_s + adaptive_.timing.dwell_s +
           (run.table_g > 0 ? 2 * adaptive_.timing.ramp_s : 0);
}

AdaptivePlan::Decision AdaptivePlan::outlook() const {
    return next(planning::covariance_after(prior_, experiments_, {}), {}, 0, 0);
}

AdaptivePlan::Decision AdaptivePlan::next(const std::vector<double>& covariance,
                                          const std::array<double, 3>& here_deg, double elapsed_s,
                                          std::size_t dwells) const {
    Decision decision;
    auto plan = planning::augment(covariance, experiments_, target_, kFarthest);
    const bool too_few = plan.runs.empty() && dwells < kFewestDwells;
    auto nearer = target_;
    for (int step = 0; step < kNearest && plan.runs.empty() && dwells < kFewestDwells; ++step) {
        for (double& one : nearer) one *= 0.8;
        plan = planning::augment(covariance, experiments_, nearer, kFarthest);
    }
    std::array<double, 3> worst{};
    for (std::size_t i = 0; i < target_.size(); ++i) {
        const double sigma = std::sqrt(covariance[i * target_.size() + i]);
        worst[estimator::order_of(i)] = std::max(worst[estimator::order_of(i)], sigma);
    }
    std::string state = "largest standard errors";
    std::string unmet;
    for (std::size_t k = 0; k < worst.size(); ++k) {
        state += proto::printed("%s %s %.3g", k == 0 ? "" : ",", kKinds[k], worst[k]);
        if (!(adaptive_.target[k] > 0)) continue;
        state += proto::printed(" (target %.3g)", adaptive_.target[k]);
        if (worst[k] > adaptive_.target[k])
            unmet += (unmet.empty() ? "" : ", ") + std::string(kKinds[k]);
    }
    if (plan.runs.empty()) {
        decision.verdict = Verdict::targets_met;
        decision.words = "every target is met: " + state;
        return decision;
    }
    decision.run = candidates_[plan.runs.front()];
    const std::size_t fewest = kFewestDwells - std::min(dwells, kFewestDwells);
    decision.left = std::max(plan.runs.size(), fewest);
    auto at = here_deg;
    for (const std::size_t j : plan.runs) {
        decision.left_s += time_of(candidates_[j], at);
        at = candidates_[j].position_deg;
    }
    decision.left_s *= static_cast<double>(decision.left) / static_cast<double>(plan.runs.size());
    const double limit_s = adaptive_.time_limit_s - adaptive_.closing_s;
    const bool limited = adaptive_.time_limit_s > 0;
    if (limited && elapsed_s + time_of(decision.run, here_deg) > limit_s) {
        decision.verdict = Verdict::time_limit;
        decision.words = "the time limit has come; targets missed: " + unmet + "; " + state;
        return decision;
    }
    decision.words =
        state + proto::printed("; %s%zu more dwells, %.0f s", plan.met ? "" : "more than ",
                               decision.left, decision.left_s);
    if (too_few)
        decision.words += "; every target is met, but fewer than " + std::to_string(kFewestDwells) +
                          " dwells do not tell what the bias did";
    if (limited && elapsed_s + decision.left_s > limit_s)
        decision.words += ": the time limit will come first";
    return decision;
}

}  // namespace vibrig::plan
