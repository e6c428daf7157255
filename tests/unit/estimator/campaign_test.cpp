#include <gtest/gtest.h>

#include <cmath>

#include "estimator/identification.hpp"
#include "estimator/result.hpp"
#include "tests/unit/estimator/rig_simulator.hpp"

namespace vibrig::estimator::testing {
namespace {

TEST(Campaign, TwoLevelsDetermineAllThirtyCoefficients) {
    const std::uint64_t seed = 1;
    SCOPED_TRACE("seed " + std::to_string(seed));
    // GIVEN the 14 positions at 6 and 4.667 g on the platform
    Identification identification{Settings{}};
    RigSimulator rig(seed);
    rig.campaign(identification, {6.0, 4.667});

    // WHEN the result is taken
    const Result result = identification.result();

    // THEN every coefficient is observable and within 4 sigma of the truth
    for (std::size_t i = 0; i < kParameters; ++i) {
        EXPECT_TRUE(result.observable[i]) << parameter_names()[i];
        EXPECT_LT(std::abs(result.value[i] - kTable2[i]), 4 * result.sigma[i])
            << parameter_names()[i];
    }
    EXPECT_TRUE(result.combinations.empty());
    EXPECT_NEAR(result.nis_per_dof, 1.0, 0.02);
}

}  // namespace
}  // namespace vibrig::estimator::testing
