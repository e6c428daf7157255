#include "estimator/identification/crlb.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "tests/unit/estimator/rig_simulator.hpp"

namespace vibrig::estimator::testing {
namespace {

std::vector<PlannedDwell> both_runs(double first_g, double second_g) {
    std::vector<PlannedDwell> plan;
    for (double a : {first_g, second_g}) {
        for (const auto& position : kTable1) plan.push_back({position, 1 + a * a / 2, 100});
    }
    return plan;
}

TEST(CramerRao, RateVarianceOfAHundredSeconds) {
    EXPECT_NEAR(std::sqrt(rate_variance(Settings{}, 100, 0.025)), 0.00699, 5e-6);
}

TEST(CramerRao, TableOfPlansIsReproduced) {
    struct Row {
        std::size_t group;
        std::array<double, 9> sigma;  // x y z at 9/7 g, 9/0 g, 0/2 g
    };
    const std::array<Row, 10> table{{
        {kDt, {.006003, .006003, .006003, .002151, .002151, .002151, .004629, .004629, .004629}},
        {kDi, {.005157, .002883, .002445, .003665, .002666, .002236, .00494, .002849, .002423}},
        {kDs, {.002445, .005157, .002883, .002236, .003665, .002666, .002423, .00494, .002849}},
        {kDo, {.002883, .002445, .005157, .002666, .002236, .003665, .002849, .002423, .00494}},
        {kDii, {.000496, .000424, .000395, .000312, .000266, .000205, .004446, .003653, .00328}},
        {kDss, {.000395, .000496, .000424, .000205, .000312, .000266, .00328, .004446, .003653}},
        {kDoo, {.000424, .000395, .000496, .000266, .000205, .000312, .003653, .00328, .004446}},
        {kDis, {.00049, .000616, .00049, .000548, .000653, .000549, .005109, .006357, .005115}},
        {kDio, {.000616, .00049, .00049, .000653, .000549, .000548, .006357, .005115, .005109}},
        {kDos, {.00049, .00049, .000616, .000549, .000548, .000653, .005115, .005109, .006357}},
    }};
    const std::array<std::array<double, 2>, 3> plans{{{6, 14.0 / 3}, {6, 0}, {0, 4.0 / 3}}};
    for (std::size_t p = 0; p < plans.size(); ++p) {
        const auto sigma =
            predicted_sigma(Settings{}, both_runs(plans[p][0], plans[p][1]), kTable2, 0.025);
        for (const Row& row : table) {
            for (std::size_t gyro = 0; gyro < 3; ++gyro) {
                for (std::size_t name = 0; name < kParameters; ++name) {
                    if (internal_of(name) != internal_index(row.group, gyro)) continue;
                    EXPECT_NEAR(sigma[name], row.sigma[3 * p + gyro], 6e-7)
                        << "plan " << p << " " << parameter_names()[name];
                }
            }
        }
    }
}

TEST(CramerRao, OneLevelLeavesTheSquaresUndetermined) {
    const auto sigma =
        predicted_sigma(Settings{}, both_runs(6, 6), std::array<double, kParameters>{}, 0.025);
    for (std::size_t i = 0; i < kParameters; ++i) {
        const std::size_t place = i % 10;
        const bool undetermined = place == 0 || (place >= 4 && place <= 6);
        EXPECT_EQ(std::isinf(sigma[i]), undetermined) << parameter_names()[i];
    }
}

}  // namespace
}  // namespace vibrig::estimator::testing
