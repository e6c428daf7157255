#include "estimator/commissioning/amplitude_unit.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

namespace vibrig::estimator::commissioning {
namespace {

TEST(AmplitudeUnit, AnAccelerometerAtTheTableTellsAllUnitsApart) {
    for (const auto& [name, factor] : {std::pair{"g peak", 1.0},
                                       {"g rms", std::sqrt(2.0)},
                                       {"g peak-peak", 0.5},
                                       {"m/s2 peak", 1 / 9.80665},
                                       {"m/s2 rms", std::sqrt(2.0) / 9.80665}}) {
        for (const double error : {0.97, 1.0, 1.03}) {
            const auto found = amplitude_unit(factor * error, 0.02);
            EXPECT_TRUE(found.decided) << name;
            EXPECT_EQ(std::string(found.all[0].name), name);
        }
    }
}

TEST(AmplitudeUnit, TheOddsAreThoseOfASquareRootOfTwo) {
    // ln(sqrt 2) = 0.3466 of ln(1 + uncertainty), squared and halved
    EXPECT_NEAR(amplitude_unit(1, 0.02).all[1].ln_ratio, -153.1, 0.1);
    EXPECT_NEAR(amplitude_unit(1, 0.10).all[1].ln_ratio, -6.61, 0.01);
    EXPECT_NEAR(amplitude_unit(1, 0.20).all[1].ln_ratio, -1.81, 0.01);
}

TEST(AmplitudeUnit, IsolatorsThatNobodyMeasuredLeavePeakAndRmsOpen) {
    EXPECT_FALSE(amplitude_unit(1, 0.10).decided);
    EXPECT_FALSE(amplitude_unit(1, 0.20).decided);
}

TEST(AmplitudeUnit, WhatFitsNoUnitIsNotDecided) {
    EXPECT_FALSE(amplitude_unit(0.75, 0.02).decided);
    EXPECT_FALSE(amplitude_unit(0, 0.02).decided);
    EXPECT_FALSE(amplitude_unit(std::nan(""), 0.02).decided);
}

}  // namespace
}  // namespace vibrig::estimator::commissioning
