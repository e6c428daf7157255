#include "estimator/plan/optimum.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <random>
#include <vector>

#include "estimator/plan/evaluation.hpp"
#include "tests/unit/estimator/plan/cube_problem.hpp"

namespace vibrig::estimator::plan {
namespace {

/// Runs per unit of effort, as evaluate() takes them.
Effort effort_of(const Optimum& optimum, const Problem& problem) {
    Effort effort(optimum.share);
    for (std::size_t i = 0; i < effort.size(); ++i) effort[i] /= problem.points[i].cost;
    return effort;
}

TEST(Plan, TheOptimumFulfilsTheEquivalenceTheorem) {
    // GIVEN candidate sets with unequal noise and costs, and one with 2000 random directions
    std::vector<Problem> problems{rig({0, 2, 4, 4.667, 6}), rig({0, 6}), rig({6, 4.667})};
    problems.push_back(rig({0, 3, 6}));
    for (std::size_t i = 26; i < 78; ++i) {
        problems.back().points[i].noise = 1 + 0.1 * static_cast<double>(i % 7);
        problems.back().points[i].cost = 1.5;
    }
    std::mt19937_64 random(7);
    std::normal_distribution<double> normal;
    problems.emplace_back();
    for (int i = 0; i < 2000; ++i) {
        Vec3 u{normal(random), normal(random), normal(random)};
        const double n = std::sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
        for (double& x : u) x /= n;
        problems.back().points.push_back({vibration_row(u, i % 2 == 0 ? 0.0 : 5.0)});
    }
    // Two spheres on a turntable: the outer one alone cannot do, though all its points are better
    problems.emplace_back();
    for (const double radius : {1.0, 10.0}) {
        for (Vec3 x : cube_directions()) {
            for (double& value : x) value *= radius;
            problems.back().points.push_back({turntable_row(x)});
        }
    }
    EXPECT_TRUE(evaluate(problems.back(), effort_of(d_optimum(problems.back()), problems.back()))
                    .identifies_all());
    for (const Problem& problem : problems) {
        SCOPED_TRACE(problem.size());
        const Optimum best = d_optimum(problem);
        // THEN max d - p is below 1e-6, the shares are a distribution, and no plan is better
        EXPECT_LT(best.gap, 1e-6);
        EXPECT_NEAR(std::accumulate(best.share.begin(), best.share.end(), 0.0), 1.0, 1e-9);
        const Evaluation e = evaluate(problem, effort_of(best, problem));
        EXPECT_NEAR(e.log_det, best.log_det, 1e-6);
        EXPECT_NEAR(equivalence_bound(problem, effort_of(best, problem)), 1.0, 1e-6);
        const Evaluation uniform = evaluate(problem, ones(problem));
        EXPECT_LE(uniform.log_det, best.log_det);
        // AND the bound holds for another plan: efficiency >= p / max d
        EXPECT_GE(d_efficiency(uniform, best.log_det) + 1e-12,
                  equivalence_bound(problem, ones(problem)));
        // AND the A and E brackets enclose
        for (const Bracket& b : {a_optimum(problem), e_optimum(problem)}) {
            EXPECT_LE(b.lower_bound, b.value * (1 + 1e-9));
            EXPECT_GT(b.lower_bound, 0.9 * b.value);
        }
    }
    EXPECT_THROW(static_cast<void>(d_optimum(rig({6}))), PlanError);
}

}  // namespace
}  // namespace vibrig::estimator::plan
