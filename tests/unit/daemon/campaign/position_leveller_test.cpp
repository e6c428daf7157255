#include "daemon/campaign/position_leveller.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "estimator/filter/angles.hpp"

namespace vibrig::campaign {
namespace {

TEST(LevellingBlock, IsATenthOfASecondAtEveryRateThatIsStated) {
    EXPECT_EQ(levelling_block(0.025), 4U);
    EXPECT_EQ(levelling_block(0.01), 10U);
    EXPECT_EQ(levelling_block(1), 1U);
    EXPECT_THROW((void)levelling_block(0), std::invalid_argument);
}

TEST(PositionLeveller, NoTorquerIsToldMoreThanTheLimitAtAnyAttitude) {
    // GIVEN torquers that do 100 deg/h, and both channels 2 deg off, which asks for more
    LevellingSettings settings;
    settings.torquer_limit_deg_h = 100;
    const estimator::Settings rig;
    const RigFrame frame(rig);
    double largest = 0;
    for (int outer = 0; outer < 180; outer += 15) {
        for (int azimuth = 0; azimuth < 360; azimuth += 15) {
            for (int turned = 0; turned < 360; turned += 30) {
                const Vector at{static_cast<double>(outer), 0, static_cast<double>(azimuth)};
                PositionLeveller stage(settings, rig, 0.025, 3276.7);
                stage.begin(at, {});
                const auto [north, east] = frame.north_east_at_deg(at);
                const Vector up = frame.up_at_deg(at);
                const double way = turned * estimator::kRadPerDeg;
                rt::Motion motion;
                motion.good = true;
                for (std::size_t i = 0; i < 3; ++i)
                    motion.force[i] =
                        up[i] + 0.035 * (std::cos(way) * north[i] + std::sin(way) * east[i]);
                // WHEN it levels
                for (int k = 0; k < 40; ++k)
                    for (const double rate : stage.step(motion))
                        largest = std::max(largest, std::abs(rate));
            }
        }
    }
    // THEN no axis is commanded more
    EXPECT_LE(largest, 100 * (1 + 1e-9));
    EXPECT_GE(largest, 99.9);
}

}  // namespace
}  // namespace vibrig::campaign
