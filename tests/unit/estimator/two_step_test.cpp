#include "estimator/two_step.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/estimator/rig_simulator.hpp"

namespace vibrig::estimator::testing {
namespace {

/// What a perfect run at `kappa` finds with the squares along the output axes fixed at zero.
RunSolution perfect_run(double kappa, double sigma_constant) {
    RunSolution run;
    run.kappa = kappa;
    for (std::size_t i = 0; i < kParameters; ++i) run.value[internal_of(i)] = kTable2[i];
    for (std::size_t gyro = 0; gyro < kGyros; ++gyro) {
        double& oo = run.value[internal_index(kDoo, gyro)];
        run.value[internal_index(kDt, gyro)] += kappa * oo;
        run.value[internal_index(kDii, gyro)] -= oo;
        run.value[internal_index(kDss, gyro)] -= oo;
        oo = 0;
        const auto t = static_cast<Eigen::Index>(internal_index(kDt, gyro));
        run.covariance(t, t) = sigma_constant * sigma_constant;
    }
    return run;
}

TEST(TwoStep, RecoveryIsExactInAnyOrderOfTheRuns) {
    const double kappa1 = 19, kappa2 = 1 + 98.0 / 9, s1 = 0.01, s2 = 0.02;
    const RunSolution one = perfect_run(kappa1, s1), two = perfect_run(kappa2, s2);
    for (bool swapped : {false, true}) {
        RunSolution joined;
        ASSERT_TRUE(recover(swapped ? two : one, swapped ? one : two, joined));
        for (std::size_t i = 0; i < kParameters; ++i) {
            EXPECT_NEAR(joined.value[internal_of(i)], kTable2[i], 1e-12) << parameter_names()[i];
        }
        const double d = kappa1 - kappa2;
        const auto t = static_cast<Eigen::Index>(internal_index(kDt, 1));
        const auto o = static_cast<Eigen::Index>(internal_index(kDoo, 1));
        EXPECT_NEAR(std::sqrt(joined.covariance(o, o)), std::hypot(s1, s2) / d, 1e-15);
        EXPECT_NEAR(std::sqrt(joined.covariance(t, t)), std::hypot(kappa1 * s2, kappa2 * s1) / d,
                    1e-14);
    }
}

TEST(TwoStep, EqualLevelsAreRefused) {
    RunSolution joined;
    EXPECT_FALSE(recover(perfect_run(19, 1), perfect_run(19, 1), joined));
}

}  // namespace
}  // namespace vibrig::estimator::testing
