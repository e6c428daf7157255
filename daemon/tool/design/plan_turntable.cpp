#include "daemon/tool/design/plan_turntable.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numeric>
#include <stdexcept>

#include "daemon/tool/design/plan_study.hpp"
#include "daemon/tool/design/plan_terms.hpp"
#include "estimator/plan/exact.hpp"
#include "estimator/plan/optimum.hpp"
#include "estimator/plan/spheres.hpp"
#include "proto/json_number.hpp"
#include "proto/json_text.hpp"

namespace vibrig::tool::planner {

namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kFaces = 6, kEdges = 12;
constexpr std::size_t kSixRuns = 8, kEightRuns = 6;  // [6]8 + [8]6
constexpr std::size_t kMostRuns = 1000;
constexpr double kSameSphere = 0.05;

/// [6]8 + [8]6 as the paper's surviving words allow it.
planning::Counts allocated(const std::string& allocation) {
    const std::size_t directions = planning::cube_directions().size();
    planning::Counts counts(2 * directions, 0);
    for (std::size_t i = 0; i < directions; ++i) {
        const bool face = i < kFaces, corner = i >= kFaces + kEdges;
        const bool inner = allocation == "both" || face == (allocation == "split-68");
        const bool outer = allocation == "both" || !inner;
        const std::size_t runs = face ? kSixRuns : corner ? kEightRuns : 0;
        counts[i] = inner ? runs : 0;
        counts[directions + i] = outer ? runs : 0;
    }
    return counts;
}

void check(const TurntableRequest& request) {
    const auto& spheres = request.spheres;
    for (std::size_t i = 1; i < spheres.size(); ++i) {
        if (spheres[i] <= spheres[i - 1])
            throw std::runtime_error("--spheres: found " + printed("%g", spheres[i]) +
                                     ", expected growing radii");
    }
    if (request.allocation != "free" && spheres.size() != 2) {
        throw std::runtime_error("--allocation: found " + request.allocation + " with " +
                                 std::to_string(spheres.size()) + " spheres, expected two of them");
    }
    if (request.allocation != "free" && request.runs > 0) {
        throw std::runtime_error("found --runs with --allocation " + request.allocation +
                                 ", which has its own number, expected one of them");
    }
}

void find_growth(const planning::Counts& counts, const planning::Terms& terms,
                 TurntablePlan& plan) {
    const planning::Effort effort = planning::effort_of(counts);
    const auto log_det = [&](double r) {
        const auto e = planning::evaluate(planning::spheres_problem({1, r}, terms), effort);
        return e.log_det + static_cast<double>(e.coefficients) * std::log(e.effort);
    };
    for (const double r : {1.1, 1.5, 2.0, 3.0, 5.0, 10.0}) {
        plan.growth.push_back({r, log_det(r) / std::log(10.0)});
    }
    plan.growth_exponent = (log_det(2000) - log_det(1000)) / std::log(2.0);
}

void judge(const planning::Problem& problem, TurntablePlan& plan) {
    if (!plan.evaluation.identifies_all()) {
        plan.refusal =
            printed("rank %zu of %zu: %s not determined", plan.evaluation.rank,
                    plan.evaluation.coefficients, plan.evaluation.undetermined().c_str());
        if (plan.request.spheres.size() == 1) {
            plan.refusal +=
                "; on one sphere D0 and the squares are one combination: a second "
                "radius (--spheres) tells them apart";
        }
        return;
    }
    const planning::Optimum best = planning::d_optimum(problem);
    plan.d_efficiency = planning::d_efficiency(plan.evaluation, best.log_det);
    const std::size_t directions = planning::cube_directions().size();
    for (std::size_t k = 0; k < plan.request.spheres.size(); ++k) {
        const auto first = best.share.begin() + static_cast<std::ptrdiff_t>(k * directions);
        plan.optimal_shares.emplace_back(
            plan.request.spheres[k],
            std::accumulate(first, first + static_cast<std::ptrdiff_t>(directions), 0.0));
    }
}

}  // namespace

std::size_t TurntablePlan::run_count() const {
    std::size_t sum = 0;
    for (const TurntableRun& run : runs) sum += run.count;
    return sum;
}

TurntablePlan turntable_plan(const TurntableRequest& request) {
    check(request);
    TurntablePlan plan;
    plan.request = request;
    const planning::Terms terms = terms_without(request.without);
    const planning::Problem problem = planning::spheres_problem(request.spheres, terms);
    const std::size_t directions = planning::cube_directions().size();
    const std::size_t runs = request.runs > 0 ? request.runs : 2 * problem.coefficients();
    planning::Counts counts;
    const planning::Evaluation all =
        planning::evaluate(problem, planning::Effort(problem.size(), 1));
    if (request.allocation != "free") {
        counts = allocated(request.allocation);
    } else if (all.identifies_all()) {
        planning::ExactSearch search;
        search.seed = request.seed;
        counts = planning::exact_design(problem, std::min(runs, kMostRuns), search);
    } else {
        counts.assign(problem.size(), 1);  // all there is, to say what it does not tell
    }
    for (std::size_t i = 0; i < problem.size(); ++i) {
        if (counts[i] == 0) continue;
        const double radius = request.spheres[i / directions];
        const auto& f = problem.points[i].f;
        plan.runs.push_back({{f[1], f[2], f[3]}, radius, counts[i]});
    }
    const planning::Effort effort = planning::effort_of(counts);
    plan.evaluation = planning::evaluate(problem, effort);
    plan.bound = planning::equivalence_bound(problem, effort);
    judge(problem, plan);
    if (plan.refusal.empty() && request.spheres.size() == 2) find_growth(counts, terms, plan);
    return plan;
}

std::string turntable_json(const TurntablePlan& plan) {
    Json runs = Json::array(), errors = Json::object(), growth = Json::array(),
         shares = Json::array();
    for (const TurntableRun& run : plan.runs)
        runs.push_back({{"input", run.input}, {"radius", run.radius}, {"count", run.count}});
    for (std::size_t k = 0; k < planning::kTerms; ++k) {
        const double sigma = plan.evaluation.sigma[k];
        if (sigma != 0) errors[planning::kTermNames[k]] = proto::number_or_null(sigma);
    }
    for (const Growth& g : plan.growth) growth.push_back({{"r", g.r}, {"log10_det", g.log10_det}});
    for (const auto& [sphere, share] : plan.optimal_shares)
        shares.push_back({{"radius", sphere}, {"share", share}});
    const bool complete = plan.refusal.empty();
    Json json{
        {"d_efficiency", plan.d_efficiency},
        {"bound", plan.bound},
        {"rank", plan.evaluation.rank},
        {"coefficients", plan.evaluation.coefficients},
        {"runs", std::move(runs)},
        {"run_count", plan.run_count()},
        {"spheres", plan.request.spheres},
        {"allocation", plan.request.allocation},
        {"unit_standard_errors", std::move(errors)},
        {"condition", complete ? Json(plan.evaluation.condition) : Json(nullptr)},
        {"optimal_shares", std::move(shares)},
        {"growth", std::move(growth)},
        {"growth_exponent", plan.growth.empty() ? Json(nullptr) : Json(plan.growth_exponent)}};
    if (!complete) json["refusal"] = plan.refusal;
    return proto::json_text(json);
}

std::string turntable_table(const TurntablePlan& plan) {
    std::string text = "      x1 (input)  x2 (output)    x3 (spin)   sphere  times\n";
    for (const TurntableRun& run : plan.runs) {
        text += printed("  %14.7g %12.7g %12.7g %8.4g %6zu\n", run.input[0], run.input[1],
                        run.input[2], run.radius, run.count);
    }
    text += printed("\n%zu runs, rank %zu of %zu\n", plan.run_count(), plan.evaluation.rank,
                    plan.evaluation.coefficients);
    if (!plan.refusal.empty()) return text;
    text += printed("D-efficiency %.4f (at least %.4f by the equivalence bound)\n",
                    plan.d_efficiency, plan.bound);
    text += "optimum over the same spheres:";
    for (const auto& [sphere, share] : plan.optimal_shares)
        text += printed("  %.4f of the runs at %.4g", share, sphere);
    text += "\nstandard errors for unit noise of a run:\n ";
    for (std::size_t k = 0; k < planning::kTerms; ++k) {
        if (plan.evaluation.sigma[k] != 0)
            text += printed(" %s %.3g", planning::kTermNames[k], plan.evaluation.sigma[k]);
    }
    text += '\n';
    if (!plan.growth.empty()) {
        text += "det M of the same runs on spheres 1 and r, decades:\n ";
        for (const Growth& g : plan.growth) text += printed(" r %g: %.2f", g.r, g.log10_det);
        text += printed("; for large r as r^%.0f\n", plan.growth_exponent);
        const auto& spheres = plan.request.spheres;
        if (spheres[1] / spheres[0] - 1 < kSameSphere) {
            text += "warning: spheres nearer than 5 % hardly tell D0 from the squares\n";
        }
    }
    return text;
}

std::string turntable_csv(const TurntablePlan& plan) {
    std::string text = "run,x1,x2,x3,y\n";
    std::size_t number = 1;
    for (const TurntableRun& run : plan.runs) {
        for (std::size_t k = 0; k < run.count; ++k) {
            text += printed("%zu,%.17g,%.17g,%.17g,\n", number++, run.input[0], run.input[1],
                            run.input[2]);
        }
    }
    return text;
}

}  // namespace vibrig::tool::planner
