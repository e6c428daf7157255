#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "estimator/plan/positions.hpp"
#include "estimator/uncertainty/balanced_order.hpp"
#include "tests/unit/estimator/rig_simulator.hpp"
#include "tests/unit/estimator/uncertainty/theory_rows.hpp"

namespace vibrig::estimator::uncertainty {
namespace {

using estimator::testing::PlannedRow;

struct Campaign {
    explicit Campaign(const std::vector<PlannedRow>& plan) {
        const Settings settings;
        for (const PlannedRow& row : plan) {
            const auto& at =
                estimator::testing::kTable1[static_cast<std::size_t>(row.position - 1)];
            visits.push_back({at, row.amplitude_g});
            rows.push_back(plan::vibration_row(plan::up_at(settings, at), row.amplitude_g));
        }
        order.resize(plan.size());
        std::iota(order.begin(), order.end(), std::size_t{0});
    }
    [[nodiscard]] OrderMerit merit() const {
        return merit_of(visits, order, rows, {}, estimator::testing::kRateVariance);
    }
    std::vector<plan::Visit> visits;
    std::vector<plan::Row> rows;
    plan::Order order;
};

TEST(Order, MeritsOfTheKnownOnesAreThoseOfTheTable) {
    const OrderMerit sequential = Campaign(estimator::testing::sequential(6, 14.0 / 3)).merit();
    // The table's dwells follow one another every 160 s; these as slews and ramps let them, faster.
    EXPECT_GT(sequential.bias, 4.5);
    EXPECT_LT(sequential.largest, 5.3);
    EXPECT_GT(sequential.step, 1000);
    const OrderMerit pairs = Campaign(estimator::testing::pairs(6, 14.0 / 3)).merit();
    EXPECT_GT(pairs.largest, 2.1);
    EXPECT_LT(pairs.largest, 2.6);
    EXPECT_NEAR(pairs.step, 2.5, 0.1);
    const OrderMerit balanced = Campaign(estimator::testing::balanced(6, 14.0 / 3)).merit();
    EXPECT_LT(balanced.largest, 1.3);
    EXPECT_NEAR(balanced.step, 1.04, 0.01);
    EXPECT_NEAR(sequential.slewing_s, 486, 20);
    EXPECT_NEAR(balanced.slewing_s, 576, 20);
}

TEST(Order, FoundByExchangeConfoundsNothing) {
    const Campaign listed(estimator::testing::sequential(6, 14.0 / 3));
    SearchSettings how;
    how.starts = 1;
    how.moves = 1500;
    SCOPED_TRACE("seed " + std::to_string(how.seed));
    Campaign found = listed;
    found.order =
        balanced_order(listed.visits, listed.rows, {}, estimator::testing::kRateVariance, how);
    EXPECT_TRUE(std::is_permutation(found.order.begin(), found.order.end(), listed.order.begin()));
    const OrderMerit merit = found.merit();
    EXPECT_LT(merit.step, 1.3);
    EXPECT_LT(merit.largest, 1.6);
    EXPECT_EQ(found.order, balanced_order(listed.visits, listed.rows, {},
                                          estimator::testing::kRateVariance, how));
}

TEST(Order, OfAFewDwellsStaysAsItIs) {
    const Campaign all(estimator::testing::sequential(6, 14.0 / 3));
    const std::vector<plan::Visit> few(all.visits.begin(), all.visits.begin() + 6);
    const std::vector<plan::Row> rows(all.rows.begin(), all.rows.begin() + 6);
    EXPECT_EQ(balanced_order(few, rows, {}, 5e-5), (plan::Order{0, 1, 2, 3, 4, 5}));
}

}  // namespace
}  // namespace vibrig::estimator::uncertainty
