#include "tests/unit/daemon/campaign/campaign_fixture.hpp"

namespace vibrig::campaign {
namespace {

constexpr estimator::SweptSine kUp{20, 80, 40};
/// A sine at 9 g, then a sweep.
struct SweepDwellTest : CampaignTest {
    SweepDwellTest() {
        settings.table_g = {9};
        settings.stops = {{{0, 0, 0}, 9}, {{0, 0, 90}, 2, 0, false, 1}};
        settings.stops[1].sweep = kUp;
        settings.stops[1].along.fill(1);
        make();
    }
    CommandReply begin() {
        static_cast<void>(command(Kind::arm));
        return command(Kind::start);
    }
};

TEST_F(SweepDwellTest, IsChosenAtRestAndSaidToTheEstimator) {
    EXPECT_NE(command(Kind::arm).message.find("sweep from 20 to 80 Hz in 40 s"), std::string::npos);
    static_cast<void>(command(Kind::start));
    ASSERT_TRUE(run_until(CampaignState::finished, 300)) << status().reason;
    const auto first = std::ranges::find_if(shaker.requests,
                                            [](const auto& one) { return one.sweep.has_value(); });
    ASSERT_NE(first, shaker.requests.end());
    EXPECT_EQ(*first->sweep, (drivers::SweepSetPoint{20, 80, 3}));
    EXPECT_EQ(first->amplitude_g, 2);
    ASSERT_NE(first, shaker.requests.begin());
    EXPECT_EQ((first - 1)->amplitude_g, 0);
    ASSERT_EQ(orders.size(), 2U);
    EXPECT_FALSE(orders[0].dwell.sweep.any());
    EXPECT_EQ(orders[1].dwell.sweep, kUp);
    EXPECT_NEAR(drivers::to_seconds(orders[1].to - orders[1].from),
                estimator::spectrum::SweepBounds(kUp, settings.swept_by).dwell_s(), 2e-6);
    ASSERT_EQ(stops_done.size(), 2U);
    EXPECT_EQ(stops_done[1].sweep_to_hz, 80);
    EXPECT_NE(orders[0].dwell.run, orders[1].dwell.run);
}

TEST_F(SweepDwellTest, IsNotWrittenWhileThePlatformMoves) {
    static_cast<void>(begin());
    while (shaker.requests.empty() && drivers::to_seconds(now) < 100) run_rig();
    accelerometers.platform_g = 0.3;
    run_for(100);
    EXPECT_TRUE(std::ranges::none_of(shaker.requests,
                                     [](const auto& one) { return one.sweep.has_value(); }));
}

}  // namespace
}  // namespace vibrig::campaign
