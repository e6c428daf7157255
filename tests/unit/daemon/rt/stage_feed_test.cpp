#include "daemon/rt/stage_feed.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <initializer_list>
#include <span>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include "estimator/filter/angles.hpp"
#include "tests/unit/drivers/rig_frames.hpp"

namespace vibrig::rt {
namespace {

using drivers::kMillisecond;
using drivers::kSecond;
using drivers::Time;

TEST(StageFeed, PairsIncrementsByTheirCounterAndAccountsForEveryFrame) {
    const proto::Dbc dbc = proto::parse_dbc(proto::rig_dbc_text(), "rig.dbc");
    StageFeedSettings settings;
    EXPECT_THROW(StageFeed(dbc, settings, nullptr), std::invalid_argument);
    settings.increments = true;
    settings.block = 4;
    StageFeed feed(dbc, settings, nullptr);
    drivers::Sample sample;
    feed.take(sample);
    const auto gyro = [&](int counter, Time t) {
        return feed.take(
            test::frame_of(dbc, "GyroIncrements", t, {{"X", 2.0}, {"Counter", counter}}));
    };
    const auto force = [&](int counter, Time t) {
        return feed.take(test::frame_of(dbc, "AccelerometerIncrements", t,
                                        {{"Z", 0.098}, {"Counter", counter}}));
    };
    // Not asked for: taken off the way of the samples, counted, not given out.
    EXPECT_TRUE(gyro(0, kSecond));
    EXPECT_TRUE(force(0, kSecond));
    feed.order(StageFeed::Mode::increments);
    const Time t = 2 * kSecond;
    EXPECT_TRUE(gyro(254, t));
    EXPECT_TRUE(force(254, t));
    gyro(1, t + 30 * kMillisecond);  // two lost, across the wrap
    force(1, t + 30 * kMillisecond);
    gyro(2, t + 40 * kMillisecond);
    force(3, t + 50 * kMillisecond);  // partners lost
    gyro(4, t + 60 * kMillisecond);
    force(4, t + 60 * kMillisecond);
    gyro(8, t + 2660 * kMillisecond);  // once round and four more
    force(8, t + 2660 * kMillisecond);
    std::vector<double> at;
    Motion motion;
    while (feed.pop(motion)) {
        at.push_back(drivers::to_seconds(motion.time - t));
        EXPECT_NEAR(motion.turn[0], 2 * estimator::kRadPerDeg / 3600, 1e-12);
        EXPECT_NEAR(motion.force[2], 0.098, 1e-9);
        EXPECT_TRUE(motion.good);
    }
    EXPECT_THAT(
        at, testing::ElementsAre(0, testing::DoubleNear(0.03, 1e-9),
                                 testing::DoubleNear(0.06, 1e-9), testing::DoubleNear(2.66, 1e-9)));
    const auto c = feed.counters();
    EXPECT_EQ(c.received, 12U);
    EXPECT_EQ(c.received, 2 * c.pairs + c.alone + c.unasked);
}

}  // namespace
}  // namespace vibrig::rt
