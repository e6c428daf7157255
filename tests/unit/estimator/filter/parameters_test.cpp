#include "estimator/filter/parameters.hpp"

#include <gtest/gtest.h>

#include <array>
#include <string>
#include <vector>

namespace vibrig::estimator {
namespace {

TEST(Parameters, OrdersAreThoseOfTheSpecificForceInTheNames) {
    using Names = std::vector<std::string>;
    std::array<Names, 3> of_order;
    for (std::size_t i = 0; i < kGroups; ++i)
        of_order.at(order_of(i)).emplace_back(parameter_names()[i]);
    EXPECT_EQ(of_order[0], Names{"D_Fx"});
    EXPECT_EQ(of_order[1], (Names{"D_Ix", "D_Ox", "D_Sx"}));
    EXPECT_EQ(of_order[2], (Names{"D_IIx", "D_OOx", "D_SSx", "D_IOx", "D_ISx", "D_OSx"}));
    for (std::size_t i = kGroups; i < kParameters; ++i)
        EXPECT_EQ(order_of(i), order_of(i % kGroups)) << parameter_names()[i];
}

TEST(Parameters, AVibrationIsTheSameWithinTwoPercent) {
    EXPECT_TRUE(same_vibration(24.51, 25));
    EXPECT_TRUE(same_vibration(25.49, 25));
    EXPECT_FALSE(same_vibration(24.49, 25));
    EXPECT_FALSE(same_vibration(25.51, 25));
    // At rest is no small frequency.
    EXPECT_TRUE(same_vibration(0, 0));
    EXPECT_FALSE(same_vibration(1e-9, 0));
    EXPECT_FALSE(same_vibration(0, 1e-9));
}

}  // namespace
}  // namespace vibrig::estimator
