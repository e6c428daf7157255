#include "estimator/filter/drift_model.hpp"

#include <gtest/gtest.h>

#include <array>

#include "estimator/filter/second_moment.hpp"
#include "tests/unit/estimator/golden.hpp"

namespace vibrig::estimator::testing {
namespace {

TEST_F(Golden, RegressorsRatesAndJacobian) {
    const Regressors h = model.regressors(pose.up, 19);
    const std::array<double, kGroups> expected{1,           .377786088,  .492403877,   .784102094,
                                               2.711724242, 4.606769974, 11.681505784, 3.534443353,
                                               5.628234396, 7.335803303};
    for (std::size_t g = 0; g < kGroups; ++g) EXPECT_NEAR(h[g][0], expected[g], kDigits) << g;

    const Eigen::Vector3d w = model.platform_rate(pose, h, d.data());
    const Eigen::Vector3d rate = pose.m * w;
    EXPECT_LT((rate - Eigen::Vector3d(12.04843677, 9.063777603, 6.074928865)).norm(), 1e-8);

    Eigen::Matrix3d j;
    j << 1.507631426, 5.512113369, .00665639, -5.275992916, -.001795849, -.610101509, 9.103996277,
        1.334553268, .430641972;
    EXPECT_LT((model.jacobian(pose, second_moment(pose, {.kappa = 19}), d.data(), w) - j)
                  .cwiseAbs()
                  .maxCoeff(),
              1e-8);
}

/// Vibration along (c_N, 1, c_E) in phase.
VibrationMoment along(double c_n, double c_e, double kappa) {
    return {kappa, {c_n * c_n, 1, c_e * c_e, c_n, c_n * c_e, c_e}};
}

TEST_F(Golden, VibrationAcrossTheVerticalEntersRegressorsRatesAndJacobian) {
    const Eigen::Matrix3d s = second_moment(pose, along(0.05, 0.1, 19));
    const Regressors h = model.regressors(pose.up, s);
    const std::array<double, kGroups> expected{1,           .377786088,  .492403877,  .784102094,
                                               3.334384471, 6.070330022, 9.820285506, 4.498863128,
                                               5.716623976, 7.710592484};
    for (std::size_t g = 0; g < kGroups; ++g) EXPECT_NEAR(h[g][0], expected[g], kDigits) << g;

    const Eigen::Vector3d w = model.platform_rate(pose, h, d.data());
    EXPECT_LT((pose.m * w - Eigen::Vector3d(11.917586417, 9.071095600, 6.185667387)).norm(), 1e-8);
    Eigen::Matrix3d j;
    j << 1.481069988, 5.530953213, .060068925, -5.273058452, .194818119, -.439500821, 9.278692036,
        1.284893092, .314617527;
    EXPECT_LT((model.jacobian(pose, s, d.data(), w) - j).cwiseAbs().maxCoeff(), 1e-8);
}

TEST_F(Golden, JacobianIsTheDerivativeOfTheRates) {
    const VibrationMoment vibration = along(-0.07, 0.2, 7.5);
    const auto platform_rate = [&](const Pose& p) -> Eigen::Vector3d {
        const Regressors h = model.regressors(p.up, second_moment(p, vibration));
        return model.platform_rate(p, h, d.data());
    };
    const auto rates = [&](const Eigen::Vector3d& angles) -> Eigen::Vector3d {
        const Pose p = kinematics.pose(angles);
        return p.m * platform_rate(p);
    };
    const Eigen::Vector3d at(0.4, -0.7, 2.1);
    const Pose p = kinematics.pose(at);
    const Eigen::Matrix3d j =
        model.jacobian(p, second_moment(p, vibration), d.data(), platform_rate(p));
    for (int k = 0; k < 3; ++k) {
        const Eigen::Vector3d step = 1e-5 * Eigen::Vector3d::Unit(k);
        const Eigen::Vector3d slope = (rates(at + step) - rates(at - step)) / 2e-5;
        EXPECT_LT((slope - j.col(k)).norm(), 1e-7) << k;
    }
}

}  // namespace
}  // namespace vibrig::estimator::testing
