// What the simulated rig's gyros count while one gimbal after the other is slewed.
#include "estimator/commissioning/turns.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "tests/plant/increments.hpp"
#include "tests/plant/platform_model.hpp"

namespace vibrig::estimator::commissioning {
namespace {

using ::testing::HasSubstr;

constexpr double kTurnRad = std::numbers::pi / 180;

/// At 5 deg/s, from outer 40, inner 5, azimuth 25 deg; the drift and the Earth go on as ever.
std::vector<CountedTurn> slewed(const plant::Truth& truth, double turn_deg = 20) {
    const plant::PlatformModel platform(truth);
    std::vector<CountedTurn> turns;
    for (std::size_t gimbal = 0; gimbal < 3; ++gimbal) {
        plant::Increments gyros(truth, 25'000);
        const std::array<plant::Shake, 3> still{};
        plant::Vec3 at{40 * kTurnRad, 5 * kTurnRad, 25 * kTurnRad};
        CountedTurn one;
        const auto readings = [&](Vec3& into) {
            for (std::size_t i = 0; i < 3; ++i) into[i] = at[i] / kTurnRad;
        };
        readings(one.before);
        std::int64_t us = 0;
        for (double moved = 0; moved < turn_deg + 5; moved += 0.125) {
            plant::Increments::Motion motion;
            motion.from = at;
            if (moved >= 1 && moved < 1 + turn_deg) at[gimbal] += 0.125 * kTurnRad;
            motion.to = at;
            us += 25'000;
            gyros.advance(us, motion, platform, still);
            for (const auto& increment : gyros.made())
                for (std::size_t i = 0; i < 3; ++i)
                    one.counted_deg[i] += increment.turn_arcsec[i] / 3600;
        }
        readings(one.after);
        turns.push_back(one);
    }
    return turns;
}

TEST(Turns, EachGyrosOwnSignIsThatOfItsIncrements) {
    for (unsigned signs = 0; signs < 8; ++signs) {
        plant::Truth truth;
        for (unsigned i = 0; i < 3; ++i) truth.increment_sign[i] = (signs >> i) % 2 == 0 ? 1 : -1;
        const auto found = find_by_turns(Description{}, slewed(truth));
        ASSERT_EQ(found.verdict, Verdict::decided) << found.why;
        EXPECT_TRUE(found.named());
        EXPECT_EQ(found.sign, truth.increment_sign);
        // Drift and Earth of 30 deg/h turn by 0.04 deg in 5 s: 0.2 % of 20 deg.
        for (const double scale : found.scale) EXPECT_NEAR(scale, 1, 5e-3);
    }
}

TEST(Turns, GyrosUnderEachOthersNamesAreNamedByTheirAxes) {
    auto turns = slewed({});
    for (auto& one : turns) std::swap(one.counted_deg[0], one.counted_deg[2]);
    const auto found = find_by_turns(Description{}, turns);
    ASSERT_EQ(found.verdict, Verdict::decided) << found.why;
    EXPECT_EQ(found.axis, (std::array<int, 3>{2, 1, 0}));
    EXPECT_FALSE(found.named());
}

TEST(Turns, LostFramesDeadGyrosAndTwoOnOneAxisAreRefused) {
    const auto right = slewed({});
    const auto refused = [&right](auto change, const char* words) {
        auto turns = right;
        for (auto& one : turns) change(one.counted_deg);
        const auto found = find_by_turns(Description{}, turns);
        EXPECT_EQ(found.verdict, Verdict::refused);
        EXPECT_THAT(found.why, HasSubstr(words));
    };
    refused([](Vec3& c) { c[1] *= 0.9; }, "gyro increments Y count 0.");
    refused([](Vec3& c) { c[2] = 0; }, "gyro increments Z count 0.000");
    refused([](Vec3& c) { c[2] = c[0]; }, "Z count about platform x, as another gyro's do");
    refused([](Vec3& c) { c[0] += 0.1 * c[1]; }, "X count about an axis");
}

TEST(Turns, WithoutThreeTurnsNothingIsSaid) {
    auto turns = slewed({});
    turns[2] = turns[1];
    EXPECT_THROW(static_cast<void>(find_by_turns(Description{}, turns)), std::invalid_argument);
    turns.pop_back();
    EXPECT_THROW(static_cast<void>(find_by_turns(Description{}, turns)), std::invalid_argument);
    turns = slewed({});
    turns[0].counted_deg[0] = std::numeric_limits<double>::quiet_NaN();
    EXPECT_THROW(static_cast<void>(find_by_turns(Description{}, turns)), std::invalid_argument);
}

}  // namespace
}  // namespace vibrig::estimator::commissioning
