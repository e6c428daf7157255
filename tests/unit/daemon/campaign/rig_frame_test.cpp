#include "daemon/campaign/rig_frame.hpp"

#include <gtest/gtest.h>

#include "estimator/filter/kinematics.hpp"
#include "tests/plant/platform_model.hpp"

namespace vibrig::campaign {
namespace {

TEST(ABaseThatIsNotLevel, IsWhatTheSimulatedRigMakesOfIt) {
    // GIVEN a base whose north axis points up by 1.2 deg, whichever platform axis is up
    for (const int axis : {0, 1, 2}) {
        for (const int sign : {1, -1}) {
            plant::Truth truth;
            truth.up = {axis, sign};
            truth.azimuth_deg = 30;
            truth.base_tilt_deg = {0, 1.2};
            const plant::PlatformModel rig(truth);
            estimator::Settings settings;
            settings.up = {axis, sign};
            settings.azimuth_deg = 30;
            settings.elevation_deg = 1.2;
            const estimator::Kinematics kinematics(settings);
            // THEN vertical and Earth rate are the rig's at any attitude
            for (const plant::Vec3& angles :
                 {plant::Vec3{0, 0, 0}, plant::Vec3{0.7, -0.4, 2.1}, plant::Vec3{-2.5, 0.9, 0.3}}) {
                const auto pose = kinematics.pose({angles[0], angles[1], angles[2]});
                const auto up = rig.up_at(angles), earth = rig.earth_rate_in_platform(angles);
                for (std::size_t i = 0; i < 3; ++i) {
                    EXPECT_NEAR(pose.up[static_cast<int>(i)], up[i], 1e-12) << axis << sign;
                    EXPECT_NEAR(pose.earth_rate[static_cast<int>(i)], earth[i], 1e-10)
                        << axis << sign;
                }
            }
            // AND zeroing turns about the vertical all the same
            if (axis == 0) continue;
            for (const bool down : {false, true}) {
                const RigFrame frame(settings);
                const auto up = frame.up_at_deg(frame.azimuth_vertical_deg(37, down));
                EXPECT_NEAR(up[2], down ? -1 : 1, 1e-12) << axis << sign << down;
            }
        }
    }
}

}  // namespace
}  // namespace vibrig::campaign
