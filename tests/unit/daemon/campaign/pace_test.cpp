#include "daemon/campaign/pace.hpp"

#include <gtest/gtest.h>

namespace vibrig::campaign {
namespace {

using drivers::kSecond;
using drivers::Time;

TEST(Pace, TakesNoWarmUpForItsPace) {
    // GIVEN ten stops of 80 s, nominally 70 s, after ten minutes of warm-up
    Pace pace;
    pace.begin(0);
    EXPECT_DOUBLE_EQ(pace.left_s(10, 70, 60, 600 * kSecond), 700);
    Time now = 600 * kSecond;
    pace.enter(true, now);
    // WHEN the first stop is done THEN what is left follows from it and the nominal one
    now += 80 * kSecond;
    pace.stop_done(now);
    EXPECT_DOUBLE_EQ(pace.left_s(9, 70, 60, now), 9 * 75);
    // AND within the second one it falls second by second
    EXPECT_DOUBLE_EQ(pace.left_s(9, 70, 5, now + 20 * kSecond), 9 * 75 - 20);
    // AND never below what that one still needs
    EXPECT_DOUBLE_EQ(pace.left_s(1, 70, 5, now + 500 * kSecond), 5);
    EXPECT_DOUBLE_EQ(pace.left_s(0, 70, 5, now), 0);
}

TEST(Pace, StandsStillDuringAPause) {
    Pace pace;
    pace.begin(0);
    pace.enter(true, 0);
    pace.stop_done(70 * kSecond);
    pace.enter(false, 80 * kSecond);
    const double before = pace.left_s(4, 70, 0, 80 * kSecond);
    EXPECT_DOUBLE_EQ(before, 4 * 70 - 10);
    EXPECT_DOUBLE_EQ(pace.left_s(4, 70, 0, 9000 * kSecond), before);
    pace.enter(true, 9000 * kSecond);
    pace.stop_done(9060 * kSecond);
    EXPECT_DOUBLE_EQ(pace.left_s(3, 70, 0, 9060 * kSecond), 3 * 70);
}

}  // namespace
}  // namespace vibrig::campaign
