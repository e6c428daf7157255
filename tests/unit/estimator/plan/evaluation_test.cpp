#include "estimator/plan/evaluation.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/estimator/plan/cube_problem.hpp"

namespace vibrig::estimator::plan {
namespace {

TEST(Plan, NamesWhatOneLevelCannotTellApart) {
    // GIVEN all 26 directions at one level
    const Problem one = rig({6});
    // WHEN evaluated
    const Evaluation e = evaluate(one, ones(one));
    // THEN one direction is missing: (D0, D11, D22, D33) = (-kappa, 1, 1, 1), Tang et al. 2009, eq.
    // 10
    EXPECT_EQ(e.rank, 9U);
    ASSERT_EQ(e.null_vectors.size(), 1U);
    EXPECT_EQ(e.undetermined(), "D0, D11, D22, D33");
    const Row& v = e.null_vectors[0];
    for (const std::size_t square : {4U, 5U, 6U}) EXPECT_NEAR(v[square] / v[0], -1.0 / 19, 1e-9);
    EXPECT_TRUE(std::isinf(e.sigma[0]));
    EXPECT_TRUE(std::isfinite(e.sigma[7]));
    EXPECT_EQ(equivalence_bound(one, ones(one)), 0);
    // AND a single run at rest mends it
    Problem rest = rig({0});
    for (Point& p : rest.points) p.cost = 0.9;
    auto extra = one.points;
    extra.insert(extra.end(), rest.points.begin(), rest.points.end());
    const Remedy remedy = cheapest_remedy(one, ones(one), extra);
    EXPECT_TRUE(remedy.complete);
    ASSERT_EQ(remedy.points.size(), 1U);
    EXPECT_GE(remedy.points[0], 26U) << "one at rest";
}

TEST(Plan, TermsThatAreNeverExcitedAreNamedInSpiteOfRounding) {
    // GIVEN directions in the x-z plane, y off by rounding
    Problem flat;
    for (int k = 0; k < 12; ++k) {
        for (const double level : {0.0, 6.0}) {
            const double a = k * 3.14159265358979 / 6;
            flat.points.push_back({vibration_row({std::cos(a), 1e-17, std::sin(a)}, level)});
        }
    }
    const Evaluation e = evaluate(flat, ones(flat));
    EXPECT_EQ(e.rank, 6U);
    EXPECT_EQ(e.undetermined(), "D2, D22, D12, D23");
    // AND without those terms in the model it is complete
    flat.terms[2] = flat.terms[5] = flat.terms[7] = flat.terms[9] = false;
    EXPECT_TRUE(evaluate(flat, ones(flat)).identifies_all());
}

TEST(Plan, StandardErrorsAgreeWithTheInverseOfTheInformation) {
    // GIVEN an orthogonal design in one coefficient: D0 alone, n runs of noise 2
    Problem problem;
    problem.terms = {true, false, false, false, false, false, false, false, false, false};
    problem.points.push_back({vibration_row({0, 1, 0}, 0), 2.0, 3.0});
    const Evaluation e = evaluate(problem, {16.0});
    // THEN sigma = 2 / sqrt(16), and the determinant is per unit of cost: 16/4 / 48
    EXPECT_NEAR(e.sigma[0], 0.5, 1e-12);
    EXPECT_NEAR(e.log_det, std::log(4.0 / 48.0), 1e-12);
    EXPECT_NEAR(e.trace, 0.25 * 48, 1e-9);
}

}  // namespace
}  // namespace vibrig::estimator::plan
