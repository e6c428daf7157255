#include "daemon/domain/positions.hpp"

#include <gtest/gtest.h>

#include <set>

namespace vibrig {
namespace {

TEST(StopDone, KindsOfVibrationAreDistinguished) {
    StopDone reference, higher, random, up, down;
    higher.frequency_hz = 65.1;
    random.profile = 4;
    random.frequency_hz = 15;
    up.sweep_from_hz = down.sweep_to_hz = 20;
    up.sweep_to_hz = down.sweep_from_hz = 120;
    // A resumed campaign finds what is done by it: no two are the same, and profiles are below 0.
    const std::set<double> kinds{reference.kind(), higher.kind(), random.kind(), up.kind(),
                                 down.kind()};
    EXPECT_EQ(kinds.size(), 5U);
    EXPECT_EQ(reference.kind(), 0);
    EXPECT_EQ(higher.kind(), 65.1);
    EXPECT_EQ(random.kind(), -4);
    EXPECT_EQ(up.kind(), kind_of_sweep(20, 120));
    // Ends as near as a plan may have them
    EXPECT_NE(kind_of_sweep(20, 120), kind_of_sweep(20, 120.001));
    EXPECT_NE(kind_of_sweep(20, 120), kind_of_sweep(20.001, 120));
}

}  // namespace
}  // namespace vibrig
