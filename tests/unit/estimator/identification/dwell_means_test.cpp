#include "estimator/identification/dwell_means.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "estimator/filter/angles.hpp"

namespace vibrig::estimator {
namespace {

TEST(DwellMeans, GiveMeanSlopeAndForceOverAWrap) {
    DwellMeans means;
    for (int k = 0; k < 400; ++k) {
        Measurement m;
        m.time_s = 10 + 0.025 * k;
        // 36 deg/h through half a turn
        const double angle = std::numbers::pi + (m.time_s - 15) * 36 * kRadPerDeg / 3600;
        m.angle_rad = {angle > std::numbers::pi ? angle - 2 * std::numbers::pi : angle, 0.1, 0};
        m.force_g = {0, 1, k % 2 == 0 ? 0.5 : -0.5};
        if (k == 100) m.force_good = false;
        means.add(m);
    }
    ASSERT_TRUE(means.known());
    const auto mean = means.mean(1, true);
    EXPECT_NEAR(mean.slope_deg_h[0], 36, 1e-6);
    EXPECT_NEAR(mean.slope_deg_h[1], 0, 1e-9);
    EXPECT_NEAR(std::abs(std::remainder(mean.encoder_rad[0], 2 * std::numbers::pi)),
                std::numbers::pi, 1e-5);
    EXPECT_NEAR(mean.force_g[1], 1, 1e-12);
    EXPECT_FALSE(DwellMeans{}.known());
}

}  // namespace
}  // namespace vibrig::estimator
