#include <cmath>
#include <numbers>

#include "daemon/campaign/sweep_watch.hpp"
#include "tests/unit/daemon/campaign/campaign_fixture.hpp"

namespace vibrig::campaign {
namespace {

constexpr estimator::SweptSine kUp{20, 80, 40}, kDown{80, 20, 40};
constexpr double kRate_hz = 400;

/// What is said of a sweep, and what is shaken, second by second.
struct SweptRide {
    std::function<double(double)> said, shaken;  ///< Hz at a time since the dwell began
    estimator::SweptSine of = kUp;
    double poll_s = 0.2;
};

double law(const estimator::SweptSine& of, double begins_s, double t) {
    const double way = std::clamp((t - begins_s) / of.seconds, 0.0, 1.0);
    return of.from_hz * std::pow(of.to_hz / of.from_hz, way);
}

/// The level is there 3 s before the dwell. What it is told, and when in s; empty: nothing.
std::pair<std::string, double> watched(const SweptRide& ride) {
    rt::DwellOrder order;
    order.from = 100 * kSecond;
    order.dwell.sweep = ride.of;
    SweepWatch watch(estimator::Settings{}, order, order.from - 3 * kSecond);
    const double end_s = SweepWatch::dwell_s(ride.of);
    double phase = 0, polled = -3;
    for (double t = -3; t < end_s; t += 1 / kRate_hz) {
        phase += 2 * std::numbers::pi * ride.shaken(t) / kRate_hz;
        rt::Motion motion;
        motion.time = order.from + drivers::from_seconds(t);
        motion.force = {0, 1 + 6 * std::sin(phase), 0};
        motion.good = true;
        watch.add(motion);
        if (t < polled) continue;
        polled += ride.poll_s;
        if (auto why = watch.frequency(motion.time, ride.said(t)); !why.empty()) return {why, t};
    }
    return {"", end_s};
}

SweptRide honest(const estimator::SweptSine& of, double begins_s) {
    const auto at = [of, begins_s](double t) { return law(of, begins_s, t); };
    return {at, at, of};
}

TEST(SweepWatch, UpAndDownWheneverTheControllerBegins) {
    for (const auto& of : {kUp, kDown}) {
        for (const double begins_s : {-2.0, 2.0, 6.5}) {
            const auto [why, when] = watched(honest(of, begins_s));
            EXPECT_EQ(why, "") << begins_s << " " << when;
        }
    }
}

TEST(SweepWatch, OneThatGoesTheOtherWayIsFoundAtOnce) {
    SweptRide ride = honest(kUp, 2);
    ride.said = ride.shaken = [](double t) { return law({20, 5, 40}, 2, t); };
    const auto [why, when] = watched(ride);
    EXPECT_NE(why.find("it goes the other way"), std::string::npos) << why;
    EXPECT_LT(when, 2.5);
}

TEST(SweepWatch, OneThatStandsStillIsFoundWithinItsTime) {
    SweptRide ride = honest(kUp, 2);
    ride.said = ride.shaken = [](double) { return 20.0; };
    const auto [why, when] = watched(ride);
    EXPECT_NE(why.find("stands still at 20.000 Hz"), std::string::npos) << why;
    EXPECT_NEAR(when, -3 + SweepWatch::kBegins_s, 0.3);
    // Midway it is late by 1.5 s and 5 % of what it has lasted.
    ride.said = ride.shaken = [](double t) { return law(kUp, 2, std::min(t, 22.0)); };
    const auto [midway, then] = watched(ride);
    EXPECT_NE(midway.find("the controller is at 40.000 Hz"), std::string::npos) << midway;
    EXPECT_LT(then, 22 + SweepWatch::kLate_s + 0.05 * 25 + 0.5);
}

TEST(SweepWatch, ARateThatLiesIsFound) {
    for (const double scaled : {0.5, 0.8, 1.3, 2.0}) {
        SweptRide ride = honest(kUp, 2);
        ride.said = ride.shaken = [scaled](double t) {
            return law(kUp, 2, 2 + scaled * std::max(0.0, t - 2));
        };
        const auto [why, when] = watched(ride);
        EXPECT_NE(why.find("the controller is at"), std::string::npos) << scaled << " " << why;
        EXPECT_LT(when, 2 + SweepWatch::kLate_s / (std::abs(scaled - 1) - 0.05) + 1) << scaled;
    }
}

/// The register says what was asked for, and the table does something else.
TEST(SweepWatch, AFrequencyThatOnlyIsSaidIsContradictedByTheAccelerometers) {
    const std::vector<std::function<double(double)>> lies{
        [](double) { return 15.0; },  // another frequency, ignored
        [](double t) {
            return law({20, 5, 40}, 2, t);
        },                                                        // the other way
        [](double t) { return law(kUp, 2, std::min(t, 12.0)); },  // stands still
        [](double t) { return law(kUp, 2, 2 + 1.2 * std::max(0.0, t - 2)); }};
    for (std::size_t i = 0; i < lies.size(); ++i) {
        SweptRide ride = honest(kUp, 2);
        ride.shaken = lies[i];
        const auto [why, when] = watched(ride);
        EXPECT_NE(why.find("they vibrate at another"), std::string::npos) << i << ": " << why;
        // Three seconds, once it is half a hertz off.
        EXPECT_LT(when, i == 0 ? 4 : i == 2 ? 17 : 10) << i;
    }
}

TEST(SweepWatch, WhatIsNoFrequencyIsNone) {
    for (const double hz : {0.0, -20.0, std::nan(""), 1e9}) {
        SweptRide ride = honest(kUp, 2);
        ride.said = [hz](double t) { return t > 5 ? hz : law(kUp, 2, t); };
        const auto [why, when] = watched(ride);
        EXPECT_NE(why, "") << hz;
        EXPECT_LT(when, 5.5);
    }
}

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
    EXPECT_NEAR(drivers::to_seconds(orders[1].to - orders[1].from), SweepWatch::dwell_s(kUp), 1e-9);
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
