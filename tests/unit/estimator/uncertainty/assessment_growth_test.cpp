#include <gtest/gtest.h>

#include <ctime>
#include <iostream>
#include <random>
#include <utility>
#include <vector>

#include "estimator/uncertainty/assessment.hpp"
#include "tests/unit/estimator/uncertainty/theory_rows.hpp"

namespace vibrig::estimator::uncertainty {
namespace {

/// CPU time of one assessment of so many dwells.
double seconds(std::size_t dwells) {
    const Settings settings;
    const auto order = estimator::testing::balanced(6, 14.0 / 3);
    std::vector<estimator::testing::PlannedRow> plan;
    while (plan.size() < dwells) plan.push_back(order[plan.size() % order.size()]);
    auto rows = estimator::testing::theory_rows(settings, plan);
    std::mt19937_64 random(1);
    estimator::testing::add_noise(rows, random);
    const Result result = estimator::testing::result_of(std::move(rows));
    const std::clock_t begin = std::clock();
    const Assessment a = assess(settings, result);
    EXPECT_EQ(a.rates.size(), dwells);
    return static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
}

TEST(Growth, OfTheTimeWithTheDwellsIsThatOfTheirNumber) {
    const double few = seconds(28), more = seconds(250), many = seconds(2000);
    std::cout << "CPU time: 28 dwells " << few << " s, 250 " << more << " s, 2000 " << many
              << " s\n";
    // A Cholesky factor of n x n would make the last 512 times the one before.
    EXPECT_LT(many, 8 * 3 * more);
#ifdef NDEBUG
    EXPECT_LT(few, 0.2);
#endif
}

}  // namespace
}  // namespace vibrig::estimator::uncertainty
