#include <gtest/gtest.h>

#include <cmath>

#include "estimator/filter/drift_model.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/second_moment.hpp"
#include "estimator/identification/crlb.hpp"
#include "tests/unit/estimator/rig_simulator.hpp"

namespace vibrig::estimator::testing {
namespace {

constexpr double kDigits = 6e-10;  // nine printed decimals

ParameterArray truth_in_filter_order() {
    ParameterArray d{};
    for (std::size_t i = 0; i < kParameters; ++i) d[internal_of(i)] = kTable2[i];
    return d;
}

struct Golden : ::testing::Test {
    Kinematics kinematics{Settings{}};
    DriftModel model{Settings{}};
    Pose pose = kinematics.pose(Eigen::Vector3d(30, 10, -20) * kPi / 180.0);
    ParameterArray d = truth_in_filter_order();
};

TEST_F(Golden, KinematicsOfTheReferenceAngles) {
    Eigen::Matrix3d c, m;
    c << .925416578, .377786088, -.029695587, -.336824089, .784102094, -.521280576, -.173648178,
        .492403877, .852868532;
    m << -.954188894, .347296355, 0, -.342020143, -.939692621, 0, -.165693163, .060307379, -1;
    EXPECT_LT((pose.c - c).cwiseAbs().maxCoeff(), kDigits);
    EXPECT_LT((pose.m - m).cwiseAbs().maxCoeff(), kDigits);
    EXPECT_LT((pose.up - Eigen::Vector3d(.377786088, .784102094, .492403877)).norm(), kDigits);
    EXPECT_LT((pose.earth_rate - Eigen::Vector3d(13.782968518, 4.912731623, 3.482605825)).norm(),
              2e-9);
}

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

TEST(Kinematics, OtherVerticalsAreCyclicPermutations) {
    for (int axis = 0; axis < 3; ++axis) {
        for (int sign : {1, -1}) {
            Settings s;
            s.up = {axis, sign};
            s.azimuth_deg =
                90;  // the rig's north axis looks east: true north is behind its east axis
            const Kinematics k(s);
            EXPECT_EQ(k.up_reference()[axis], sign);
            const double horizontal = kEarthRateDegPerHour * std::cos(s.latitude_deg * kPi / 180);
            EXPECT_NEAR(k.earth_rate_reference()[(axis + 1) % 3], -sign * horizontal, 1e-12);
            EXPECT_NEAR(k.earth_rate_reference()[(axis + 2) % 3], 0, 1e-12);
            EXPECT_NEAR(k.earth_rate_reference().norm(), kEarthRateDegPerHour, 1e-12);
        }
    }
}

TEST(Kinematics, EncodersAreSignedZeroedAndWrapped) {
    Settings s;
    s.encoder_sign = {1, -1, 1};
    s.encoder_zero_deg = {350, 10, 0};
    const Eigen::Vector3d a =
        Kinematics(s).gimbal_angles({10 * kPi / 180, 5 * kPi / 180, 359 * kPi / 180});
    EXPECT_NEAR(a[0], 20 * kPi / 180, 1e-12);
    EXPECT_NEAR(a[1], 5 * kPi / 180, 1e-12);
    EXPECT_NEAR(a[2], -1 * kPi / 180, 1e-12);
    EXPECT_NEAR(wrap_next_to(0.01, 2 * kPi - 0.01), 2 * kPi + 0.01, 1e-12);
}

std::vector<PlannedDwell> both_runs(double first_g, double second_g) {
    std::vector<PlannedDwell> plan;
    for (double a : {first_g, second_g}) {
        for (const auto& position : kTable1) plan.push_back({position, 1 + a * a / 2, 100});
    }
    return plan;
}

TEST(CramerRao, RateVarianceOfAHundredSeconds) {
    EXPECT_NEAR(std::sqrt(rate_variance(Settings{}, 100, 0.025)), 0.00699, 5e-6);
}

TEST(CramerRao, TableOfPlansIsReproduced) {
    struct Row {
        std::size_t group;
        std::array<double, 9> sigma;  // x y z at 9/7 g, 9/0 g, 0/2 g
    };
    const std::array<Row, 10> table{{
        {kDt, {.006003, .006003, .006003, .002151, .002151, .002151, .004629, .004629, .004629}},
        {kDi, {.005157, .002883, .002445, .003665, .002666, .002236, .00494, .002849, .002423}},
        {kDs, {.002445, .005157, .002883, .002236, .003665, .002666, .002423, .00494, .002849}},
        {kDo, {.002883, .002445, .005157, .002666, .002236, .003665, .002849, .002423, .00494}},
        {kDii, {.000496, .000424, .000395, .000312, .000266, .000205, .004446, .003653, .00328}},
        {kDss, {.000395, .000496, .000424, .000205, .000312, .000266, .00328, .004446, .003653}},
        {kDoo, {.000424, .000395, .000496, .000266, .000205, .000312, .003653, .00328, .004446}},
        {kDis, {.00049, .000616, .00049, .000548, .000653, .000549, .005109, .006357, .005115}},
        {kDio, {.000616, .00049, .00049, .000653, .000549, .000548, .006357, .005115, .005109}},
        {kDos, {.00049, .00049, .000616, .000549, .000548, .000653, .005115, .005109, .006357}},
    }};
    const std::array<std::array<double, 2>, 3> plans{{{6, 14.0 / 3}, {6, 0}, {0, 4.0 / 3}}};
    for (std::size_t p = 0; p < plans.size(); ++p) {
        const auto sigma =
            predicted_sigma(Settings{}, both_runs(plans[p][0], plans[p][1]), kTable2, 0.025);
        for (const Row& row : table) {
            for (std::size_t gyro = 0; gyro < 3; ++gyro) {
                for (std::size_t name = 0; name < kParameters; ++name) {
                    if (internal_of(name) != internal_index(row.group, gyro)) continue;
                    EXPECT_NEAR(sigma[name], row.sigma[3 * p + gyro], 6e-7)
                        << "plan " << p << " " << parameter_names()[name];
                }
            }
        }
    }
}

TEST(CramerRao, OneLevelLeavesTheSquaresUndetermined) {
    const auto sigma =
        predicted_sigma(Settings{}, both_runs(6, 6), std::array<double, kParameters>{}, 0.025);
    for (std::size_t i = 0; i < kParameters; ++i) {
        const std::size_t place = i % 10;
        const bool undetermined = place == 0 || (place >= 4 && place <= 6);
        EXPECT_EQ(std::isinf(sigma[i]), undetermined) << parameter_names()[i];
    }
}

}  // namespace
}  // namespace vibrig::estimator::testing
