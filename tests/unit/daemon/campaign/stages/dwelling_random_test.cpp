#include "tests/unit/daemon/campaign/random_dwell.hpp"

namespace vibrig::campaign {
namespace {

using drivers::RandomReading;

TEST_F(RandomDwellTest, IsChosenAtRestAndSaidToTheEstimator) {
    EXPECT_NE(
        command(Kind::arm).message.find("profile 'broad' (number 4, checksum 89abcdef, up to 2 g "
                                        "rms, 3 sigma 6 g)"),
        std::string::npos);
    static_cast<void>(command(Kind::start));
    ASSERT_TRUE(run_until(CampaignState::finished, 200)) << status().reason;
    const auto first = std::ranges::find_if(shaker.requests,
                                            [](const auto& one) { return one.random.has_value(); });
    ASSERT_NE(first, shaker.requests.end());
    EXPECT_EQ(*first->random, (drivers::RandomSetPoint{4, -3, 0x89abcdef}));
    EXPECT_EQ(first->amplitude_g, 2);
    // The set-point before it is the ramp down of the sine.
    ASSERT_NE(first, shaker.requests.begin());
    EXPECT_EQ((first - 1)->amplitude_g, 0);
    ASSERT_EQ(orders.size(), 2U);
    EXPECT_EQ(orders[0].dwell.random.mean_square_g2, 0);
    EXPECT_EQ(orders[1].dwell.random.mean_square_g2, 1);
    EXPECT_EQ(orders[1].dwell.random.profile, 4);
    ASSERT_EQ(stops_done.size(), 2U);
    EXPECT_EQ(stops_done[1].profile, 4);
    EXPECT_NE(orders[0].dwell.run, orders[1].dwell.run);
}

TEST_F(RandomDwellTest, IsArmedForTheLoudestOfEachProfileAndItsThreeSigma) {
    // GIVEN a sine at 5 g, one profile at two levels and another at a third
    settings.stops = {{{0, 0, 0}, 5}};
    const auto add = [&](std::uint16_t profile, const char* name, double rms_g, double decibels) {
        settings.stops.push_back({{0, 0, 90}, rms_g, 0, false, 0.5});
        settings.stops.back().random =
            RandomStop{{profile, decibels, 0x89abcdef},
                       {rms_g * rms_g / 4, 100, 0.01, 500, profile, decibels},
                       1,
                       name};
    };
    add(4, "broad", 1, -6);
    add(4, "broad", 2, 0);
    add(7, "narrow", 3, 0);
    make();
    const std::string said = command(Kind::arm).message;
    // THEN people arm for three sigma of the loudest, and see each profile's own
    EXPECT_THAT(said, testing::HasSubstr("up to 9 g at the table"));
    EXPECT_THAT(said, testing::HasSubstr("profile 'broad' (number 4, checksum 89abcdef, up to 2 g "
                                         "rms, 3 sigma 6 g)"));
    EXPECT_THAT(said, testing::HasSubstr("profile 'narrow' (number 7, checksum 89abcdef, up to 3 g "
                                         "rms, 3 sigma 9 g)"));
    // AND the interlock has the same
    static_cast<void>(command(Kind::start));
    while (ramps.empty() && drivers::to_seconds(now) < 100) run_rig();
    ASSERT_FALSE(ramps.empty());
    EXPECT_EQ(ramps.front().armed_g, 9);
}

/// Isolators that let more through than is configured do so under a random vibration, too.
TEST_F(RandomDwellTest, TakesTheTransmissionThatTheLoopCheckMeasured) {
    settings.rig.transmission = 0.6;
    settings.stops.push_back({{0, 0, 0}, 9, 25.1, false, 0.3});
    settings.stops[1].random->bands = {{10, 0.5, 1}, {100, 0.5, 1}};
    settings.read_psd = true;
    make();
    ProofRecord proof;
    proof.table_g = 0.5;
    proof.keys_sha256 = sha256(settings.proof.keys);
    proof.transmission = 0.6 * 1.02;
    proof.transmissions = {{25.1, 0.3 * 1.04}};
    campaign->take_over_proofs({proof});
    static_cast<void>(begin());
    shaker.psd_answer = {1, {{20, 0.01}, {120, 0.01}}, ""};
    played.summary.samples = 400;
    ASSERT_TRUE(run_until(CampaignState::finished, 300)) << status().reason;
    // Below 15 Hz as at 15, above 25.1 as there; half the power each.
    const double ratio = (1.02 * 1.02 + 1.04 * 1.04) / 2;
    EXPECT_NEAR(orders[1].dwell.random.mean_square_g2, ratio, 1e-12);
    ASSERT_EQ(reported_psds.size(), 1U);
    EXPECT_NEAR(reported_psds[0].power_ratio, ratio, 1e-12);
}

/// What the accelerometers do not show at the reference frequency does not lack at the platform.
TEST_F(RandomDwellTest, TransmissionIsMeasuredThroughTheAccelerometers) {
    settings.rig.transmission = 0.6;
    settings.rig.accelerometer_response.bandwidth_hz = 30;
    const double seen = std::sqrt(settings.rig.accelerometer_response.power(settings.frequency_hz));
    ASSERT_LT(seen, 0.95);
    settings.stops[1].random->bands = {{10, 0.5, 1}, {100, 0.5, 1}};
    make();
    ProofRecord proof;
    proof.table_g = 0.5;
    proof.keys_sha256 = sha256(settings.proof.keys);
    proof.transmission = 0.6 * seen;
    campaign->take_over_proofs({proof});
    static_cast<void>(begin());
    ASSERT_TRUE(run_until(CampaignState::finished, 300)) << status().reason;
    EXPECT_NEAR(orders[1].dwell.random.mean_square_g2, 1, 1e-12);
}

TEST_F(RandomDwellTest, DoesNotBeginUntilTheControllerIsAtLevel) {
    shaker.levelled = RandomReading::State::levelling;
    static_cast<void>(begin());
    EXPECT_FALSE(run_until(CampaignState::finished, 200));
    EXPECT_EQ(orders.size(), 1U);
    EXPECT_NE(status().reason.find("expected profile 4 at -3 dB, at level"), std::string::npos)
        << status().reason;
}

TEST_F(RandomDwellTest, EndsWhereTheControllerAborts) {
    static_cast<void>(begin());
    while (orders.size() < 2 && drivers::to_seconds(now) < 200) run_rig();
    ASSERT_EQ(orders.size(), 2U);
    shaker.levelled = RandomReading::State::aborted;
    shaker.abort_reason = 2;
    run_for(2);
    EXPECT_EQ(status().state, CampaignState::aborted);
    EXPECT_NE(status().reason.find("random control aborted (its reason 2), profile 4"),
              std::string::npos)
        << status().reason;
}

TEST_F(RandomDwellTest, IsNotWrittenWhileThePlatformMoves) {
    static_cast<void>(begin());
    while (shaker.requests.empty() && drivers::to_seconds(now) < 100) run_rig();
    // Whatever the table does: the platform swings on.
    accelerometers.platform_g = 0.3;
    run_for(100);
    EXPECT_TRUE(std::ranges::none_of(shaker.requests,
                                     [](const auto& one) { return one.random.has_value(); }));
}

}  // namespace
}  // namespace vibrig::campaign
