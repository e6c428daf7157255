#include <gtest/gtest.h>

#include <cmath>

#include "estimator/filter/angles.hpp"
#include "estimator/levelling/simulation.hpp"

namespace {

using namespace vibrig::estimator::levelling;
using vibrig::estimator::kDegPerHour;
using vibrig::estimator::kRadPerArcmin;

constexpr Gains kGains{0.0264, 202.5, 0.9045};  // sigma 0.0088, xi 0.7

Scenario moving(const Gains& gains) {
    Scenario s;
    s.network = Network::bare;
    s.loop.fast = gains;
    s.loop.settling_s = 600;
    s.loop.period_s = 0.1;
    s.duration_s = 3000;
    return s;
}

double last_tilt(const Scenario& s) { return simulate(s).trace.back().tilt[0]; }

TEST(Vehicle, InternalDampingFollowsTheApparentVertical) {
    // GIVEN a carrier that speeds up at 0.02 m/s^2 and a network without a reference
    Scenario s = moving(kGains);
    s.motion = {{0, 3000, {0.02, 0}}};
    s.internal = true;
    // THEN eq. 1 leaves (1 - H(0)) / H(0) a / g, H(0) = K3 / K1: all but 3 % of the acceleration
    const double h0 = kGains.k3 / kGains.k1;
    const double expected = (1 - h0) / h0 * 0.02 / s.loop.earth.gravity_mps2;
    EXPECT_NEAR(last_tilt(s), expected, 2e-3 * std::abs(expected));
    // and with the velocity from outside nothing of it, at a constant error of it neither
    s.internal = false;
    s.reference_error = {0.5, 0};
    EXPECT_NEAR(last_tilt(s), 0, 0.01 * kRadPerArcmin);
}

TEST(Vehicle, WithoutTheIntegratorDriftLeavesATilt) {
    // GIVEN K3 = 0, a drift of 0.1 deg/h and a zero of 1e-5 g
    Scenario s = moving({kGains.k1, kGains.k2, 0});
    s.drift = {0.1 * kDegPerHour, 0};
    s.zero = {1e-5 * s.loop.earth.gravity_mps2, 0};
    // THEN eq. 8: K1 eps / ((1 + K2) ws^2) - dA / g
    const double expected = steady_tilt(s.loop.fast, s.drift[0], s.zero[0], s.loop.earth);
    EXPECT_NEAR(expected,
                kGains.k1 * s.drift[0] / ((1 + kGains.k2) * s.loop.earth.schuler_squared()) - 1e-5,
                1e-12);
    EXPECT_NEAR(last_tilt(s), expected, 1e-3 * std::abs(expected));
    // and with K3 eq. 9: the zero alone
    s.loop.fast = kGains;
    EXPECT_NEAR(last_tilt(s), -1e-5, 1e-8);
}

TEST(Vehicle, MonteCarloNoiseOfTheReferenceTiltsAsTheBudgetSays) {
    // GIVEN a drive with stops, and a reference velocity with 0.2 m/s noise at 1 Hz, 20 seeds
    double squares = 0;
    double count = 0;
    constexpr int kSeeds = 20;
    constexpr double kForgotten = 1000;
    NoiseBudget budget;
    for (int seed = 1; seed <= kSeeds; ++seed) {
        Scenario s = moving(kGains);
        s.loop.period_s = 1;
        s.loop.noise.reference_mps = 0.2;
        s.duration_s = 6000;
        s.motion = {{100, 120, {0.8, 0}}, {1000, 1020, {-0.8, 0}}, {2000, 2040, {0.4, 0.2}}};
        s.seed = static_cast<std::uint64_t>(seed);
        budget = noise_budget(s.loop.fast, s.loop.noise, 1, s.loop.earth);
        const SimulatedStart run = simulate(s);
        // The loop begins at the first sample of the reference and forgets its error.
        for (const TracePoint& p : run.trace) {
            if (p.time_s < kForgotten) continue;
            squares += p.tilt[0] * p.tilt[0];
            ++count;
        }
    }
    // THEN the tilt's deviation is section 5's: 20 x 5000 s of noise with 1 / sigma = 114 s hold
    // 880 / 2 independent values, 1 sigma 3.4 %; sampling at 1 s adds 1 %
    EXPECT_NEAR(std::sqrt(squares / count) / budget.reference, 1, 3 * 0.034 + 0.02)
        << "seeds from 1";
}

}  // namespace
