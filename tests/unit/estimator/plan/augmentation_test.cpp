#include "estimator/plan/augmentation.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "estimator/identification/crlb.hpp"
#include "estimator/plan/positions.hpp"

namespace vibrig::estimator::plan {
namespace {

TEST(Plan, AugmentationMeetsTargetsWithFewRuns) {
    // GIVEN the prior of the filter and 100 s dwells at 26 directions, 0 and 6 g
    const Settings settings;
    std::vector<Experiment> experiments;
    for (const double level : {0.0, 6.0}) {
        for (const Vec3& u : cube_directions()) {
            const auto p = position_for(settings, u, {});
            experiments.push_back(
                {rate_rows(settings, {*p, kappa_of(level), 100}, {}, 0.025), 1.0});
        }
    }
    std::vector<double> prior, target;
    for (std::size_t i = 0; i < kParameters; ++i) {
        const bool bias = i % 10 == 0, linear = i % 10 < 4;
        prior.push_back(bias || linear ? 10 : 1);
        target.push_back(bias ? 0.008 : linear ? 0.004 : 0.0006);
    }
    const auto start = covariance_after(prior, experiments, {});
    // WHEN asked for the fewest runs
    const Augmentation a = augment(start, experiments, target, 100);
    // THEN the targets are met, by an independent sum of information, and one run less misses them
    EXPECT_TRUE(a.met);
    const auto sigma_after = [&](std::size_t runs) {
        std::vector<double> done(experiments.size(), 0.0);
        for (std::size_t k = 0; k < runs; ++k) done[a.runs[k]] += 1;
        const auto cov = covariance_after(prior, experiments, done);
        double worst = 0;
        for (std::size_t i = 0; i < kParameters; ++i)
            worst = std::max(worst, std::sqrt(cov[i * kParameters + i]) / target[i]);
        return worst;
    };
    EXPECT_LE(sigma_after(a.runs.size()), 1.0 + 1e-9);
    EXPECT_GT(sigma_after(a.runs.size() - 1), 1.0);
    EXPECT_GE(a.runs.size(), 10U);
    // Ten coefficients, 2.8 / sqrt(n) and 1.7 / sqrt(n) times 0.007 deg/h at best (Li et al. 2017,
    // rotatable optimum): n = 9 already for the linear terms; twice the optimum is too many.
    EXPECT_LE(a.runs.size(), 20U);
    EXPECT_FALSE(augment(start, experiments, target, 8).met);
    EXPECT_TRUE(augment(start, experiments, std::vector<double>(30, 0.0), 8).runs.empty());
    EXPECT_THROW(static_cast<void>(augment({1.0}, experiments, target, 8)), PlanError);
}

}  // namespace
}  // namespace vibrig::estimator::plan
