#include "daemon/record/replay.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "daemon/dwells/player.hpp"
#include "tests/unit/daemon/record/recording.hpp"

namespace vibrig::record {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

Campaign two_dwells(std::vector<drivers::Sample> samples) {
    Campaign campaign;
    campaign.samples = std::move(samples);
    for (const int position : {1, 2}) {
        const std::size_t first = position == 1 ? 100 : 2100;
        campaign.orders.push_back({campaign.samples[first - 50].time, campaign.samples[first].time,
                                   campaign.samples[first + 1500].time, 1, position, 9.0, false});
    }
    return campaign;
}

TEST_F(Recording, ReplaysToTheSameBitsAndSeesAChangedOne) {
    // GIVEN a campaign of two dwells, as it was the first time
    Campaign campaign = two_dwells(samples(4000, drivers::kSecond));
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

TEST_F(Recording, IsComparedInEveryColumnOfItsDwells) {
    Campaign campaign = two_dwells(samples(4000, drivers::kSecond));
    campaign.dwells = replay(campaign, {}, {}).dwells;
    ASSERT_EQ(campaign.dwells.size(), 2U);
    const auto difference = [&](const auto& change) {
        Campaign changed = campaign;
        change(changed.dwells[1]);
        const auto replayed = replay(changed, {}, {});
        EXPECT_EQ(replayed.different, replayed.first_difference.empty() ? 0U : 1U);
        EXPECT_EQ(replayed.as_recorded(), replayed.first_difference.empty());
        return replayed.first_difference;
    };
    EXPECT_THAT(difference([](Dwell& dwell) { dwell.numbers->rate[1] = 7; }),
                AllOf(StartsWith("run 1 position 2: /dwells/rate: row 2, number 2: found 7, the "
                                 "replay gives "),
                      Not(HasSubstr("gives 7"))));
    EXPECT_THAT(difference([](Dwell& dwell) { dwell.numbers->sync_arcsec += 1e-9; }),
                HasSubstr("/dwells/sync_arcsec: row 2: found"));
    EXPECT_THAT(difference([](Dwell& dwell) { dwell.summary.used -= 1; }),
                HasSubstr("/dwells/used: row 2: found"));
    EXPECT_THAT(difference([](Dwell& dwell) { dwell.summary.mean_force_g += 1e-9; }),
                HasSubstr("/dwells/mean_force_g: row 2: found"));
    EXPECT_THAT(difference([](Dwell& dwell) { dwell.value[2] += 1e-9; }),
                HasSubstr("/dwells/value: row 2, D_Ox: found"));
    EXPECT_THAT(difference([](Dwell& dwell) { dwell.covariance[31] *= 2; }),
                HasSubstr("/dwells/covariance: row 2, number 32: found"));
    EXPECT_THAT(difference([](Dwell& dwell) { dwell.summary.kappa = std::nan(""); }),
                HasSubstr("/dwells/kappa: row 2: found no number, the replay gives "));
    // WHEN it was done, and what an older recording lacks, are not
    EXPECT_EQ(difference([](Dwell& dwell) {
                  dwell.time += 1;
                  dwell.numbers.reset();
              }),
              "");
}

TEST_F(Recording, HasNoMoreAndNoFewerDwellsThanItsReplay) {
    // GIVEN a campaign that ended, and its dwells
    Campaign campaign = two_dwells(samples(4000, drivers::kSecond));
    campaign.dwells = replay(campaign, {}, {}).dwells;
    campaign.state = "finished";
    ASSERT_TRUE(replay(campaign, {}, {}).as_recorded());
    Campaign longer = campaign, shorter = campaign;
    // WHEN one of them is there twice, or is not there
    longer.dwells.push_back(longer.dwells.back());
    shorter.dwells.pop_back();
    // THEN it is not as recorded
    EXPECT_EQ(replay(longer, {}, {}).first_difference, "/dwells: found 3 rows, the replay gives 2");
    EXPECT_EQ(replay(shorter, {}, {}).first_difference,
              "/dwells: found 1 rows, the replay gives 2");
    EXPECT_FALSE(replay(longer, {}, {}).as_recorded());
    // What a daemon that was killed had not written yet is no difference.
    shorter.state = "recovered";
    EXPECT_TRUE(replay(shorter, {}, {}).as_recorded());
}

TEST_F(Recording, HasTheLevelsThatWereCommanded) {
    // GIVEN a campaign with what was commanded, each second
    Campaign campaign = two_dwells(samples(4000, drivers::kSecond));
    for (const Order& order : campaign.orders)
        for (drivers::Time at = order.from; at < order.to; at += drivers::kSecond) {
            ConditionRow& row = campaign.conditions.emplace_back();
            row.time = at;
            row.command_g = at < order.from + drivers::kSecond ? 0 : order.table_g;
        }
    ASSERT_EQ(replay(campaign, {}, {}).first_difference, "");
    // WHEN the level of one dwell is another
    campaign.orders[1].table_g = 7;
    EXPECT_EQ(replay(campaign, {}, {}).first_difference,
              "run 1 position 2: /orders/table_g: row 2: found 7, expected 9 as in "
              "/conditions/command_g of its time");
    // Nobody says what was commanded: of raw logs.
    campaign.conditions.clear();
    EXPECT_EQ(replay(campaign, {}, {}).first_difference, "");
}

TEST_F(Recording, IsComparedWithItsEstimates) {
    Campaign campaign = two_dwells(samples(4000, drivers::kSecond));
    campaign.dwells = replay(campaign, {}, {}).dwells;
    // GIVEN what a recorder saw: in a dwell some samples ago, and after its end
    dwells::Player player{estimator::Settings{}};
    rt::DwellOrder order;
    order.from = campaign.orders[0].from;
    order.to = campaign.orders[0].to;
    order.dwell = campaign.orders[0].dwell();
    player.order(order);
    const auto see = [&](std::size_t first, std::size_t end, std::size_t at, bool after) {
        for (std::size_t i = first; i < end; ++i) player.push({&campaign.samples[i], 1});
        estimator::Estimate e = player.shown();
        if (!after) player.book().identification().estimate(e);
        campaign.estimates.push_back({campaign.samples[at].time, e.amplitude_g, e.frequency_hz,
                                      e.kappa, e.nis_per_dof, e.innovation_arcsec, e.value,
                                      e.sigma});
    };
    see(0, 900, 912, false);
    see(900, 901, 899, false);  // the recorder was behind
    see(901, 902, 110, false);  // by far
    see(902, 1601, 1650, true);
    auto replayed = replay(campaign, {}, {});
    EXPECT_EQ(replayed.estimates, 4U);
    EXPECT_TRUE(replayed.as_recorded()) << replayed.first_difference;
    // THEN one last bit of any is seen, and named
    campaign.estimates[1].sigma[3] = std::nextafter(campaign.estimates[1].sigma[3], 0.0);
    replayed = replay(campaign, {}, {});
    EXPECT_EQ(replayed.estimates_different, 1U);
    EXPECT_FALSE(replayed.as_recorded());
    EXPECT_THAT(replayed.first_difference,
                StartsWith(std::string("/estimates/sigma: row 2, ") +
                           estimator::parameter_names()[3] + ": found "));
    campaign.estimates[3].kappa += 1e-9;
    EXPECT_EQ(replay(campaign, {}, {}).estimates_different, 2U);
    // Beside all dwells there is nothing to compare with.
    for (auto& row : campaign.estimates) row.time = campaign.samples[1900].time;
    EXPECT_EQ(replay(campaign, {}, {}).estimates, 0U);
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
