#include "daemon/record/replay.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/unit/daemon/record/recording.hpp"

namespace vibrig::record {
namespace {

TEST_F(Recording, ReplaysToTheSameBitsAndSeesAChangedOne) {
    // GIVEN a campaign of two dwells, as it was the first time
    Campaign campaign;
    campaign.samples = samples(4000, drivers::kSecond);
    for (const int position : {1, 2}) {
        const std::size_t first = position == 1 ? 100 : 2100;
        campaign.orders.push_back({campaign.samples[first - 50].time, campaign.samples[first].time,
                                   campaign.samples[first + 1500].time, 1, position, 9.0, false});
    }
    estimator::Settings settings;
    const auto once = replay(campaign, settings, {});
    ASSERT_EQ(once.dwells.size(), 2U);
    EXPECT_EQ(once.dwells[0].summary.samples, 1500U);
    EXPECT_GT(once.dwells[0].summary.used, 1400U);
    campaign.dwells = once.dwells;
    // WHEN it is replayed, at another speed too
    for (const double speed : {0.0, 2000.0}) {
        const auto again = replay(campaign, settings, {.speed = speed});
        EXPECT_EQ(again.compared, 2U);
        EXPECT_EQ(again.different, 0U) << again.first_difference;
    }
    // THEN one last bit in one sample is seen
    double& angle = campaign.samples[900].angle[1];
    angle = std::nextafter(angle, 1.0);
    EXPECT_GT(replay(campaign, settings, {}).different, 0U);
}

TEST_F(Recording, ThatOrdersADwellToEndBeforeItBeginsHasNoSampleInIt) {
    Campaign campaign;
    campaign.samples = samples(4000, drivers::kSecond);
    campaign.orders.push_back({campaign.samples[1900].time, campaign.samples[2000].time,
                               campaign.samples[100].time, 1, 1, 9.0, false});
    const auto dwells = recorded_dwells(campaign);
    ASSERT_EQ(dwells.size(), 1U);
    EXPECT_EQ(dwells[0].count, 0U);
    EXPECT_EQ(live_result(campaign, {}).samples, 0U);
    const auto replayed = replay(campaign, {}, {});
    ASSERT_EQ(replayed.dwells.size(), 1U);
    EXPECT_EQ(replayed.dwells[0].reason, "no samples");
}

TEST_F(Recording, HasTheSameResultReplayedAndIdentified) {
    // GIVEN a marked campaign whose zeros in place leave 1 % of the level unsure
    Campaign campaign;
    campaign.samples = samples(4000, drivers::kSecond);
    campaign.mark = "a zero has moved";
    for (const int position : {1, 2}) {
        const std::size_t first = position == 1 ? 100 : 2100;
        Order order{campaign.samples[first - 50].time,
                    campaign.samples[first].time,
                    campaign.samples[first + 1500].time,
                    1,
                    position,
                    9.0,
                    false};
        order.level_sigma_g = 0.01;
        order.noise = estimator::noise_levels({});
        campaign.orders.push_back(order);
    }
    const auto replayed = replay(campaign, {}, {}).result;
    const auto identified = live_result(campaign, {});
    // THEN both say so, and once
    ASSERT_EQ(identified.amplitudes.size(), 1U);
    EXPECT_GT(identified.amplitudes[0].sigma_g, 0.009 * identified.amplitudes[0].amplitude_g);
    EXPECT_EQ(identified.amplitudes[0].sigma_g, replayed.amplitudes.at(0).sigma_g);
    EXPECT_EQ(identified.warnings, replayed.warnings);
    EXPECT_EQ(std::ranges::count(identified.warnings, "campaign marked: a zero has moved"), 1);
}

}  // namespace
}  // namespace vibrig::record
