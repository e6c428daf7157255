#include "estimator/filter/kinematics.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/estimator/golden.hpp"

namespace vibrig::estimator::testing {
namespace {

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

TEST(Kinematics, OtherVerticalsAreCyclicPermutations) {
    for (int axis = 0; axis < 3; ++axis) {
        for (int sign : {1, -1}) {
            Settings s;
            s.up = {axis, sign};
            s.azimuth_deg =
                90;  // the rig's north axis looks east: true north is behind its east axis
            const Kinematics k(s);
            EXPECT_EQ(k.level()(axis, 1), sign);
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

TEST(SameBits, AnAngleIsWrappedAsByRemainder) {
    for (int i = -100'000; i <= 100'000; ++i) {
        const double angle = 1.37e-4 * i;
        EXPECT_EQ(wrap(angle), std::abs(angle) <= estimator::kPi
                                   ? angle
                                   : std::remainder(angle, 2.0 * estimator::kPi));
    }
}

}  // namespace
}  // namespace vibrig::estimator::testing
