#include "estimator/spectrum/mount.hpp"

#include <gtest/gtest.h>

#include <array>
#include <utility>
#include <vector>

namespace vibrig::estimator::spectrum {
namespace {

using Ratios = std::vector<std::pair<double, double>>;

TEST(Mounts, PowerOfBandsGoesByTheRatiosAboutThem) {
    const Ratios ratios{{20, 1.02}, {80, 1.08}};
    const auto of = [&](double hz) {
        return power_ratio(ratios, std::array<Band, 1>{{{hz, 1, 1}}});
    };
    EXPECT_DOUBLE_EQ(of(5), 1.02 * 1.02);
    EXPECT_DOUBLE_EQ(of(20), 1.02 * 1.02);
    EXPECT_NEAR(of(40), 1.02 * 1.08, 1e-12);  // half way on a logarithmic scale, squared
    EXPECT_DOUBLE_EQ(of(500), 1.08 * 1.08);
    const std::array<Band, 2> two{{{20, 0.25, 1}, {80, 0.75, 1}}};
    EXPECT_DOUBLE_EQ(power_ratio(ratios, two), 0.25 * 1.02 * 1.02 + 0.75 * 1.08 * 1.08);
    EXPECT_EQ(power_ratio({}, two), 1);
    EXPECT_EQ(power_ratio(ratios, {}), 1);
}

TEST(Mounts, MeasuredTransmissionIsStraightOnLogarithmicScalesAndReachesNoFurther) {
    Mount mount;
    mount.measured = {{10, 1}, {40, 0.25}};
    EXPECT_NEAR(*mount.transmission(20), 0.5, 1e-12);
    EXPECT_EQ(*mount.transmission(10), 1);
    EXPECT_EQ(*mount.transmission(40), 0.25);
    EXPECT_FALSE(mount.transmission(9.9));
    EXPECT_FALSE(mount.transmission(40.1));
    EXPECT_EQ(Mount({true, {}, {}}).transmission(1e4), 1);
}

/// Of the published table: 12 g, 1.5 m/s, 12 mm.
TEST(Mounts, LimitsOfTheTable) {
    const TableLimits limits;
    for (const auto& [hz, g] : {std::pair{5., 1.21}, {8., 3.09}, {10., 4.83}, {15., 10.87}})
        EXPECT_NEAR(limits.table_g(hz), g, 0.006) << hz;
    EXPECT_EQ(limits.table_g(20.7), 12);
}

}  // namespace
}  // namespace vibrig::estimator::spectrum
