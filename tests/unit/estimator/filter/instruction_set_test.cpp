#include "estimator/filter/instruction_set.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "estimator/identification/identification.hpp"
#include "estimator/identification/result.hpp"
#include "tests/unit/estimator/rig_simulator.hpp"

namespace vibrig::estimator::testing {
namespace {

struct InstructionSet : ::testing::Test {
    ~InstructionSet() override { static_cast<void>(force_instruction_set("auto")); }
};

/// 14 positions at two levels, 10 s each, with the instruction set in force.
Result campaign_with(std::string_view name) {
    EXPECT_TRUE(force_instruction_set(name));
    Identification identification{Settings{}};
    RigSimulator rig(7);
    SimulatedDwell plan;
    plan.duration_s = 10;
    rig.campaign(identification, {6.0, 4.667}, plan);
    return identification.result();
}

TEST_F(InstructionSet, AllAgreeWithinABillionthOfAStandardDeviation) {
    // GIVEN the same campaign
    const std::vector<std::string_view> names = instruction_sets();
    const Result reference = campaign_with(names.front());
    for (const std::string_view name : names) {
        SCOPED_TRACE(std::string(name));
        // WHEN each instruction set of this processor identifies it
        const Result result = campaign_with(name);
        // THEN coefficients and sigmas are the same but for rounding
        for (std::size_t i = 0; i < kParameters; ++i) {
            EXPECT_LT(std::abs(result.value[i] - reference.value[i]), 1e-9 * reference.sigma[i])
                << parameter_names()[i];
            EXPECT_LT(std::abs(result.sigma[i] / reference.sigma[i] - 1), 1e-9)
                << parameter_names()[i];
        }
        EXPECT_EQ(result.rejected, reference.rejected);
    }
}

TEST_F(InstructionSet, TheBestIsTakenUnlessAnotherIsForced) {
    const std::vector<std::string_view> names = instruction_sets();
    EXPECT_EQ(instruction_set(), names.back());
    EXPECT_TRUE(force_instruction_set(names.front()));
    EXPECT_EQ(instruction_set(), names.front());
    EXPECT_FALSE(force_instruction_set("mmx"));
    EXPECT_EQ(instruction_set(), names.front());
    EXPECT_TRUE(force_instruction_set("auto"));
    EXPECT_EQ(instruction_set(), names.back());
}

}  // namespace
}  // namespace vibrig::estimator::testing
