#include "daemon/campaign/sweep_watch.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <utility>
#include <vector>

namespace vibrig::campaign {
namespace {

using drivers::kSecond;
using estimator::SweptSine;
using estimator::spectrum::SweepBounds;
using estimator::spectrum::SweptBy;

constexpr SweptSine kRising{20, 80, 40}, kFalling{80, 20, 40};
constexpr double kSwept_hz = 400, kLevel_s = -3;
constexpr SweptBy kBy;
/// sin(pi x)/(pi x)/(1 - x^2) is the root of 0.9 there.
constexpr double kUnseen_hz = 0.28506;

/// What is said of a sweep, and what is shaken, second by second.
struct SweptRide {
    std::function<double(double)> said, shaken;  ///< Hz at a time since the dwell began
    SweptSine of = kRising;
    double poll_s = kBy.poll_s;
    unsigned jitter = 0;  ///< seed of polls that come late, by their period at most
};

double law(const SweptSine& of, double begins_s, double t) {
    const double way = std::clamp((t - begins_s) / of.seconds, 0.0, 1.0);
    return of.from_hz * std::pow(of.to_hz / of.from_hz, way);
}
/// Hz per second at f.
double hz_per_s(const SweptSine& of, double hz) {
    return hz * std::abs(std::log(of.to_hz / of.from_hz)) / of.seconds;
}

/// The level is there 3 s before the dwell. What is commanded, and when in s; empty: nothing.
std::pair<std::string, double> watched(const SweptRide& ride) {
    rt::DwellOrder order;
    order.from = 100 * kSecond;
    order.dwell.sweep = ride.of;
    SweepWatch watch(estimator::Settings{}, order, order.from + drivers::from_seconds(kLevel_s),
                     kBy);
    const double end_s = SweepBounds(ride.of, kBy).dwell_s();
    std::mt19937_64 random(ride.jitter);
    std::uniform_real_distribution<double> late(0, ride.jitter > 0 ? ride.poll_s : 0);
    double phase = 0, polled = kLevel_s;
    for (double t = kLevel_s; t < end_s; t += 1 / kSwept_hz) {
        phase += 2 * std::numbers::pi * ride.shaken(t) / kSwept_hz;
        rt::Motion motion;
        motion.time = order.from + drivers::from_seconds(t);
        motion.force = {0, 1 + 6 * std::sin(phase), 0};
        motion.good = true;
        watch.add(motion);
        if (t < polled) continue;
        polled += ride.poll_s + late(random);
        if (auto why = watch.frequency(motion.time, ride.said(t)); !why.empty()) return {why, t};
    }
    return {"", end_s};
}

SweptRide honest_ride(const SweptSine& of, double begins_s) {
    const auto at = [of, begins_s](double t) { return law(of, begins_s, t); };
    return {at, at, of};
}

TEST(SweepBounds, AreTheTheorys) {
    const double x = SweepBounds::unseen_hz();  // blocks of 1 s
    const double arc = std::numbers::pi * x, response = std::sin(arc) / arc / (1 - x * x);
    EXPECT_NEAR(response * response, estimator::spectrum::SweepBlocks::kShown, 1e-12);
    EXPECT_NEAR(x, kUnseen_hz, 1e-5);
    // 20 to 120 Hz in 300 s: 0.119 Hz a second at the beginning, 0.717 at the end; 0.517 octaves a
    // minute, of which half a step of 0.01 is 0.97 %.
    const SweepBounds slow({20, 120, 300}, kBy);
    EXPECT_NEAR(slow.off_s(20), 2.39, 0.01);
    EXPECT_NEAR(slow.off_s(120), 0.40, 0.01);
    EXPECT_NEAR(slow.rate_off(), 0.0597, 1e-4);
    EXPECT_NEAR(slow.begins_s(), 8 + 2 * 2.39 / (1 - 0.0597), 0.02);
    EXPECT_NEAR(slow.late_s(120, 100), 0.2 + 2.39 + 0.40 + 5.97, 0.02);
    EXPECT_NEAR(slow.dwell_s(), 13.08 + 0.2 + 0.40 + 300 / (1 - 0.0597), 0.1);
    // As it is polled, commanded and stated.
    const SweptBy other{2, 0.1, 0.5, 0.1, 0.1};
    const SweepBounds coarse({20, 120, 300}, other);
    EXPECT_NEAR(coarse.off_hz(), kUnseen_hz + 0.05, 1e-3);
    EXPECT_NEAR(coarse.rate_off(), 0.1 + 0.05 / 0.517, 1e-4);
    EXPECT_NEAR(coarse.begins_s(), 2 + 2 * coarse.off_s(20) / (1 - coarse.rate_off()), 1e-9);
    // A rate that its register hardly has.
    EXPECT_LE(SweepBounds({20, 22, 86'400}, kBy).rate_off(), 0.5);
}

TEST(SweepWatch, UpAndDownWheneverTheControllerBegins) {
    for (const auto& of : {kRising, kFalling}) {
        for (const double begins_s : {-2.0, 2.0, kLevel_s + kBy.begins_s}) {
            const auto [why, when] = watched(honest_ride(of, begins_s));
            EXPECT_EQ(why, "") << begins_s << " " << when;
        }
    }
}

/// Everything that is allowed at once: begins when it says at the latest, its rate off by what it
/// states and by its register's rounding, each statement off by nearly what the accelerometers do
/// not see (calibration, and a register that lags or leads), rounded, read now and then.
TEST(SweepWatch, AnHonestControllerAtItsWorstIsNeverStopped) {
    const std::vector<SweptSine> sweeps{
        kRising, kFalling, {20, 95, 100}, {95, 20, 100}, {120, 20, 150}};
    for (unsigned seed = 1; seed <= 40; ++seed) {
        std::mt19937_64 random(seed);
        std::uniform_real_distribution<double> part(0, 1);
        const SweptSine of = sweeps[seed % sweeps.size()];
        const double sign = seed % 2 == 0 ? 1 : -1, other = seed % 4 < 2 ? 1 : -1;
        const double octaves_per_minute =
            60 * std::abs(std::log2(of.to_hz / of.from_hz)) / of.seconds;
        const double rate =
            1 + sign * 0.99 * (kBy.rate_tolerance + kBy.rate_step / 2 / octaves_per_minute);
        const double begins_s = kLevel_s + (seed % 3 == 0 ? 1 : part(random)) * kBy.begins_s;
        const double budget_hz = 0.95 * kUnseen_hz, steady_hz = part(random) * budget_hz * other;
        const double lag_s =
            sign * std::min(kBy.poll_s, (budget_hz - std::abs(steady_hz)) /
                                            (hz_per_s(of, std::max(of.from_hz, of.to_hz)) * rate));
        SweptRide ride;
        ride.of = of;
        ride.jitter = seed;
        ride.shaken = [=](double t) { return law(of, begins_s, begins_s + rate * (t - begins_s)); };
        ride.said = [=, shaken = ride.shaken](double t) {
            return std::round((shaken(t - lag_s) + steady_hz) / kBy.frequency_step_hz) *
                   kBy.frequency_step_hz;
        };
        const auto [why, when] = watched(ride);
        EXPECT_EQ(why, "") << "seed " << seed << " at " << when << " s: rate " << rate
                           << ", begins " << begins_s << ", off " << steady_hz << " Hz, lags "
                           << lag_s << " s";
    }
}

/// It may begin at once: what is shown then is no longer held against its first frequency.
TEST(SweepWatch, HasMovedAsSoonAsItsRegisterSaysSo) {
    rt::DwellOrder order;
    order.from = 100 * kSecond;
    order.dwell.sweep = kRising;
    SweepWatch watch(estimator::Settings{}, order, order.from, kBy);
    EXPECT_FALSE(watch.moved());
    EXPECT_EQ(watch.frequency(order.from, 20), "");
    EXPECT_EQ(watch.frequency(order.from + kSecond / 10, 20.001), "");
    EXPECT_FALSE(watch.moved()) << "a step is its rounding";
    EXPECT_EQ(watch.frequency(order.from + kSecond / 5, 20.002), "");
    EXPECT_TRUE(watch.moved());
    EXPECT_FALSE(watch.begun()) << "what is off by less than a block shows may stand";
    EXPECT_EQ(watch.frequency(order.from + kSecond / 2, 20.3), "");
    EXPECT_TRUE(watch.begun());
}

TEST(SweepWatch, OneThatGoesTheOtherWayIsFoundAtOnce) {
    SweptRide ride = honest_ride(kRising, 2);
    ride.said = ride.shaken = [](double t) { return law({20, 5, 40}, 2, t); };
    const auto [why, when] = watched(ride);
    EXPECT_NE(why.find("it goes the other way"), std::string::npos) << why;
    // Once it is off by what a statement may be, at the next reading.
    EXPECT_LT(when, 2 + 1.1 * kUnseen_hz / hz_per_s(kRising, 20) + kBy.poll_s);
}

TEST(SweepWatch, OneThatBeginsTooLateIsFoundWithinItsTime) {
    for (unsigned seed = 1; seed <= 20; ++seed) {
        const auto& of = seed % 2 == 0 ? kRising : kFalling;
        const double octaves_per_minute = 60 * 2 / of.seconds;
        const double off = kBy.rate_tolerance + kBy.rate_step / 2 / octaves_per_minute;
        const double limit_s =
            kLevel_s + kBy.begins_s +
            2 * (kUnseen_hz + kBy.frequency_step_hz / 2) / hz_per_s(of, of.from_hz) / (1 - off);
        // A reading falls between the two.
        SweptRide ride = honest_ride(of, limit_s + 2 * kBy.poll_s);
        ride.jitter = seed;
        const auto [why, when] = watched(ride);
        EXPECT_NE(why.find("stands still at"), std::string::npos) << seed << ": " << why;
        EXPECT_GT(when, limit_s) << seed;
        EXPECT_LT(when, limit_s + 2 * kBy.poll_s + 1 / kSwept_hz) << seed;
    }
}

TEST(SweepWatch, OneThatStandsStillIsFoundWithinItsTime) {
    SweptRide ride = honest_ride(kRising, 2);
    ride.said = ride.shaken = [](double) { return 20.0; };
    const auto [why, when] = watched(ride);
    EXPECT_NE(why.find("stands still at 20.000 Hz"), std::string::npos) << why;
    EXPECT_NEAR(when, kLevel_s + SweepBounds(kRising, kBy).begins_s(), 2 * kBy.poll_s);
    // Midway, after 20 s at 40 Hz: late by t, less the rate's allowance of 20 s + t.
    ride.said = ride.shaken = [](double t) { return law(kRising, 2, std::min(t, 22.0)); };
    const auto [midway, then] = watched(ride);
    EXPECT_NE(midway.find("the controller is at 40.000 Hz"), std::string::npos) << midway;
    const double off = kBy.rate_tolerance + kBy.rate_step / 2 / 3;  // 3 octaves a minute
    const double known =
        kBy.poll_s + kUnseen_hz / hz_per_s(kRising, 20) + kUnseen_hz / hz_per_s(kRising, 40);
    const double expected = 22 + (known + off * 20) / (1 - off);
    EXPECT_GT(then, expected - kBy.poll_s);
    EXPECT_LT(then, expected + 2 * kBy.poll_s);
}

/// A rate beyond what is stated, and the time at which it has shown.
TEST(SweepWatch, ARateThatLiesIsFound) {
    for (unsigned seed = 1; seed <= 24; ++seed) {
        const SweptSine of = seed % 2 == 0 ? kRising : SweptSine{20, 95, 100};
        const double octaves_per_minute =
            60 * std::abs(std::log2(of.to_hz / of.from_hz)) / of.seconds;
        const double off = kBy.rate_tolerance + kBy.rate_step / 2 / octaves_per_minute;
        const std::array<double, 6> rates{0.5, 0.8, 1 - 2.5 * off, 1 + 2.5 * off, 1.3, 2.0};
        const double rate = rates[seed % rates.size()];
        SweptRide ride = honest_ride(of, 2);
        ride.jitter = seed;
        ride.said = ride.shaken = [of, rate](double t) {
            return law(of, 2, 2 + rate * std::max(0.0, t - 2));
        };
        // Late by |1 - rate| L, the allowance poll + off_s(from) + off_s(f) + off L.
        double lasted = 0;
        const auto shown = [&](double l) {
            const double hz = law(of, 0, rate * l);
            return std::abs(1 - rate) * l - off * l - kBy.poll_s -
                   kUnseen_hz / hz_per_s(of, of.from_hz) - kUnseen_hz / hz_per_s(of, hz);
        };
        while (shown(lasted) < 0) lasted += 0.01;
        const auto [why, when] = watched(ride);
        EXPECT_NE(why.find("the controller is at"), std::string::npos) << rate << " " << why;
        // Counted from the first reading that moved.
        const double first_s = kUnseen_hz / hz_per_s(of, of.from_hz) / rate + 2 * kBy.poll_s;
        EXPECT_GT(when, 2 + 0.95 * lasted - kBy.poll_s) << rate;
        EXPECT_LT(when, 2 + 1.05 * (lasted + first_s) + 2 * kBy.poll_s) << rate;
    }
}

/// A register that lags by more than the accelerometers leave unseen: at the frequency at which the
/// sweep has become so fast, three seconds later.
TEST(SweepWatch, AStatementThatIsOffByMoreThanABlockLeavesUnseenIsFound) {
    for (unsigned seed = 1; seed <= 20; ++seed) {
        const SweptSine of = seed % 2 == 0 ? kRising : SweptSine{20, 95, 100};
        const double lag_s = (seed % 4 < 2 ? 1.3 : -1.3) * kUnseen_hz / hz_per_s(of, of.to_hz);
        SweptRide ride = honest_ride(of, 2);
        ride.jitter = seed;
        ride.said = [of, lag_s](double t) { return law(of, 2, t - lag_s); };
        const auto [why, when] = watched(ride);
        EXPECT_NE(why.find("they vibrate at another"), std::string::npos) << seed << ": " << why;
        const auto at = [&](double share) {
            const double hz = share * kUnseen_hz / std::abs(lag_s) / hz_per_s(of, 1);
            return 2 + of.seconds * std::log(hz / of.from_hz) / std::log(of.to_hz / of.from_hz);
        };
        EXPECT_GT(when, at(0.95)) << seed;
        EXPECT_LT(when, at(1.05) + 4 + 2 * kBy.poll_s) << seed;
    }
}

/// The register says what was asked for, and the table does something else.
TEST(SweepWatch, AFrequencyThatOnlyIsSaidIsContradictedByTheAccelerometers) {
    const std::vector<std::function<double(double)>> lies{
        [](double) { return 15.0; },  // another frequency, ignored
        [](double t) {
            return law({20, 5, 40}, 2, t);
        },                                                            // the other way
        [](double t) { return law(kRising, 2, std::min(t, 12.0)); },  // stands still
        [](double t) { return law(kRising, 2, 2 + 1.2 * std::max(0.0, t - 2)); }};
    for (std::size_t i = 0; i < lies.size(); ++i) {
        SweptRide ride = honest_ride(kRising, 2);
        ride.shaken = lies[i];
        const auto [why, when] = watched(ride);
        EXPECT_NE(why.find("they vibrate at another"), std::string::npos) << i << ": " << why;
        // Three seconds, once it is half a hertz off.
        EXPECT_LT(when, i == 0 ? 4 : i == 2 ? 17 : 10) << i;
    }
}

TEST(SweepWatch, WhatIsNoFrequencyIsNone) {
    for (const double hz : {0.0, -20.0, std::nan(""), 1e9}) {
        SweptRide ride = honest_ride(kRising, 2);
        ride.said = [hz](double t) { return t > 5 ? hz : law(kRising, 2, t); };
        const auto [why, when] = watched(ride);
        EXPECT_NE(why, "") << hz;
        EXPECT_LT(when, 5.5);
    }
}

}  // namespace
}  // namespace vibrig::campaign
