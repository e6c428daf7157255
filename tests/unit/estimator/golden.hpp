#pragma once

#include <gtest/gtest.h>

#include <cstddef>

#include "estimator/filter/drift_model.hpp"
#include "estimator/filter/kinematics.hpp"
#include "tests/unit/estimator/rig_simulator.hpp"

namespace vibrig::estimator::testing {

inline constexpr double kDigits = 6e-10;  // nine printed decimals

inline ParameterArray truth_in_filter_order() {
    ParameterArray d{};
    for (std::size_t i = 0; i < kParameters; ++i) d[internal_of(i)] = kTable2[i];
    return d;
}

/// At the reference angles.
struct Golden : ::testing::Test {
    Kinematics kinematics{Settings{}};
    DriftModel model{Settings{}};
    Pose pose = kinematics.pose(Eigen::Vector3d(30, 10, -20) * kPi / 180.0);
    ParameterArray d = truth_in_filter_order();
};

}  // namespace vibrig::estimator::testing
