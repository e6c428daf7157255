#include "estimator/plan/positions.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "estimator/filter/kinematics.hpp"

namespace vibrig::estimator::plan {
namespace {

TEST(Plan, PositionsPutTheVerticalWhereItIsAsked) {
    for (int axis = 0; axis < 3; ++axis) {
        for (const int sign : {1, -1}) {
            std::size_t reached = 0;
            Settings frame;
            frame.up = {axis, sign};
            for (const Vec3& wanted : cube_directions()) {
                const auto position = position_for(frame, wanted, {});
                if (!position) continue;
                ++reached;
                const Vec3 u = up_at(frame, *position);
                for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(u[k], wanted[k], 1e-12);
                EXPECT_TRUE(axis == 0 || (*position)[1] == 0.0);
            }
            // x up at zero angles: +-z would need an inner angle of 90 deg
            EXPECT_EQ(reached, axis == 0 ? 24U : 26U);
        }
    }
    // Limits hold a turn further as well, and forbidden places are kept away from
    GimbalLimits limits;
    limits.low = {-100, -10, 0};
    limits.high = {100, 10, 270};
    limits.forbidden = {{0, 0, 90}};
    EXPECT_TRUE(limits.allow({0, 0, -90}));
    EXPECT_FALSE(limits.allow({0, 0, -45}));
    EXPECT_FALSE(limits.allow({5, 5, 95}));
    for (const Vec3& p : position_grid({}, 45, limits)) EXPECT_TRUE(limits.allow(p));
    const auto grid = position_grid({}, 45, {});
    const auto near = [](const Vec3& a, const Vec3& b) {
        return std::abs(a[0] - b[0]) + std::abs(a[1] - b[1]) + std::abs(a[2] - b[2]) < 1e-9;
    };
    const auto reached = [&](const Vec3& wanted) {
        return std::count_if(grid.begin(), grid.end(),
                             [&](const Vec3& p) { return near(up_at({}, p), wanted); });
    };
    for (std::size_t i = 0; i < 18; ++i) {
        EXPECT_EQ(reached(cube_directions()[i]), 1) << "each face and edge once";
    }
}

TEST(Plan, PositionsAreWhatTheEncodersShow) {
    // GIVEN a rig whose outer and azimuth encoders count the other way, from other zeros
    Settings rig;
    rig.encoder_sign = {-1, 1, -1};
    rig.encoder_zero_deg = {30, -2, 200};
    for (const Vec3& wanted : cube_directions()) {
        // WHEN the vertical is to lie along a direction
        const auto position = position_for(rig, wanted, {});
        ASSERT_TRUE(position);
        // THEN the filter's kinematics see it there, with the inner gimbal at its zero
        const Kinematics kinematics(rig);
        const double deg = kPi / 180;
        const auto up = kinematics
                            .pose(kinematics.gimbal_angles(
                                {deg * (*position)[0], deg * (*position)[1], deg * (*position)[2]}))
                            .up;
        for (std::size_t k = 0; k < 3; ++k) {
            EXPECT_NEAR(up[static_cast<Eigen::Index>(k)], wanted[k], 1e-12);
            EXPECT_NEAR(up_at(rig, *position)[k], wanted[k], 1e-12);
        }
        EXPECT_NEAR((*position)[1], -2, 1e-9);
    }
    // AND limits are those of the encoders
    GimbalLimits limits;
    limits.low[0] = 0;
    limits.high[0] = 120;
    for (const Vec3& p : position_grid(rig, 45, limits)) {
        EXPECT_GE(p[0], 0);
        EXPECT_LE(p[0], 120);
    }
    // AND what was asked of one rig means something else on another
    EXPECT_LT(up_at({}, *position_for(rig, {0, 0, 1}, {}))[2], 0.9);
}

}  // namespace
}  // namespace vibrig::estimator::plan
