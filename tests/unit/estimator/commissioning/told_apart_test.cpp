#include "estimator/commissioning/told_apart.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

// Where two suspects differ, against what gravity and the Earth say there.

namespace vibrig::estimator::commissioning {
namespace {

Settings site() {
    Settings s;
    s.latitude_deg = 45;
    s.azimuth_deg = 0;
    return s;
}

Suspect with(const Settings& s) { return {"", 0, s}; }

TEST(ToldApart, ASignOfTheInnerGimbalShowsWhereItLeans) {
    const Settings right = site();
    Settings wrong = right;
    wrong.encoder_sign[1] = -1;
    const auto where = told_apart(right, with(right), with(wrong));
    ASSERT_TRUE(where);
    // The vertical at the inner angle and at its opposite: two arrows of 1 g, twice 25 deg apart.
    EXPECT_EQ(std::abs(where->position_deg[1]), 25);
    EXPECT_NEAR(where->by_mg, 2e3 * std::sin(25 * std::numbers::pi / 180), 0.01);
    EXPECT_EQ(where->by_deg_h, 0);
    EXPECT_NE(where->words().find(" deg, by 845 mg"), std::string::npos) << where->words();
}

TEST(ToldApart, GravityKnowsNothingOfNorthAndDriftDoes) {
    const Settings right = site();
    Settings turned = right;
    turned.azimuth_deg = 90;
    const auto where = told_apart(right, with(right), with(turned));
    ASSERT_TRUE(where);
    // Horizontal Earth rate in two directions at right angles, seen by gimbals that stand so.
    EXPECT_GE(where->by_deg_h,
              std::sqrt(2) * 15.041 * std::cos(45 * std::numbers::pi / 180) - 0.01);
    EXPECT_NEAR(where->by_mg, 0, 1e-9);
    EXPECT_NE(where->words().find(" deg/h"), std::string::npos);
}

TEST(ToldApart, WhatExpectsTheSameEverywhereIsSaidSo) {
    const Settings right = site();
    Settings south = right;
    south.latitude_deg = -45;  // the vertical rate looks like drift
    EXPECT_FALSE(told_apart(right, with(right), with(south)));
    EXPECT_EQ(told_apart_words(right, {with(right), with(south)}),
              "no position tells the first two apart");
    EXPECT_EQ(told_apart_words(right, {with(south)}), "");
}

TEST(ToldApart, PositionsCountAsTheConfigurationDoes) {
    Settings right = site();
    right.encoder_zero_deg = {40, 5, -70};
    right.encoder_sign = {-1, 1, -1};
    Settings wrong = right;
    wrong.encoder_sign[1] = -1;
    const auto where = told_apart(right, with(right), with(wrong));
    ASSERT_TRUE(where);
    EXPECT_EQ(std::abs(where->position_deg[1]), 25);
    // A reading of 30 is 25 about the zero, and -25 with the other sign.
    EXPECT_NEAR(where->by_mg, 2e3 * std::sin(25 * std::numbers::pi / 180), 0.01);
}

}  // namespace
}  // namespace vibrig::estimator::commissioning
