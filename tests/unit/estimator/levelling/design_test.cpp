#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <string>

#include "estimator/filter/angles.hpp"
#include "estimator/levelling/noise_budget.hpp"
#include "estimator/levelling/refusal.hpp"
#include "estimator/levelling/simulation.hpp"

namespace {

using namespace vibrig::estimator::levelling;
using vibrig::estimator::kDegPerHour;
using vibrig::estimator::kPi;
using vibrig::estimator::kRadPerArcmin;
using vibrig::estimator::text;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

void expect_refusal(const std::function<void()>& call, const std::vector<std::string>& words) {
    try {
        call();
        ADD_FAILURE() << "not refused: " << words.front();
    } catch (const DesignError& error) {
        for (const std::string& word : words) {
            EXPECT_NE(std::string(error.what()).find(word), std::string::npos)
                << word << " not in: " << error.what();
        }
    }
}

TEST(LevellingDesign, SettlesWhereTheResponseCrossesTheResidualForTheLastTime) {
    for (const double damping : {0.02, 0.3, 0.5, 0.65, 0.7, 0.8, 0.99, 0.999999}) {
        for (const double residual : {0.3, 0.02, 0.005, 0.001, 1e-9}) {
            // GIVEN the product sigma t of a design
            const double x = settling_product(residual, damping);
            // THEN the response is at the residual there and within it ever after
            EXPECT_NEAR(std::abs(initial_response(x, damping)), residual, 1e-6 * residual)
                << damping << ' ' << residual;
            for (double later = x + 1e-6; later < x + 12; later += 0.003) {
                ASSERT_LE(std::abs(initial_response(later, damping)), residual * (1 + 1e-6))
                    << damping << ' ' << residual << " at " << later;
            }
        }
    }
}

TEST(LevellingDesign, TheResponseIsThatOfTheDifferentialEquations) {
    // GIVEN the loop without its sampled form: phi' = -w_c, v' = g phi - K1 v, z' = K3 v
    constexpr double kSigma = 0.05;
    for (const double damping : {0.3, 0.7, 0.95}) {
        const Earth earth;
        const Gains gains = gains_of(kSigma, damping, earth);
        using State = std::array<double, 3>;
        const auto rate = [&](const State& s) {
            return State{-((1 + gains.k2) * s[1] + s[2]) / earth.radius_m,
                         earth.gravity_mps2 * s[0] - gains.k1 * s[1], gains.k3 * s[1]};
        };
        State s{1e-3, 0, 0};
        constexpr double kStep = 0.01;
        for (int k = 1; k <= 16000; ++k) {
            const auto shifted = [&](const State& d, double h) {
                return State{s[0] + h * d[0], s[1] + h * d[1], s[2] + h * d[2]};
            };
            const State a = rate(s);
            const State b = rate(shifted(a, kStep / 2));
            const State c = rate(shifted(b, kStep / 2));
            const State d = rate(shifted(c, kStep));
            for (std::size_t i = 0; i < 3; ++i) {
                s[i] += kStep / 6 * (a[i] + 2 * b[i] + 2 * c[i] + d[i]);
            }
            // THEN eq. 15 gives the tilt
            ASSERT_NEAR(s[0] / 1e-3, initial_response(kSigma * kStep * k, damping), 1e-8)
                << damping << " at step " << k;
        }
    }
}

TEST(LevellingDesign, PlacesTheRootsAndMeetsTheSettlingTime) {
    // GIVEN a design
    const Design made = design({100, 0.005, 0.7});
    EXPECT_NEAR(made.gains.k1, 0.1575, 1e-4);  // Zha et al. 2019, eqs. 11-14 at sigma = 0.0525
    EXPECT_NEAR(made.gains.k2, 7242, 1);
    EXPECT_NEAR(made.gains.k3, 192.1, 0.1);
    // THEN its roots are where they were placed
    const double wd = made.sigma * std::sqrt(1 - 0.49) / 0.7;
    for (const auto& root : roots(made.gains)) {
        EXPECT_NEAR(root.real(), -made.sigma, 1e-9);
        EXPECT_TRUE(std::abs(root.imag()) < 1e-9 || std::abs(std::abs(root.imag()) - wd) < 1e-9);
    }
    // AND the sampled loop has settled in time, to the samples' delay
    Scenario start;
    start.loop.fast = made.gains;
    start.loop.period_s = 0.02;
    start.tilt = {0.5 * kPi / 180, 0};
    start.duration_s = 300;
    EXPECT_NEAR(simulate(start).last_above(0.005), 100, 1);
}

TEST(LevellingDesign, RefusesWhatCannotWorkWithTheNumbers) {
    expect_refusal(
        [] {
            check_stable({0.0264, 10, 0.904});
        },
        {"K1 (1 + K2) > K3", "0.2904", "0.904", "K2 must be above 33.24"});
    expect_refusal([] { check_stable({-1, 10, 1}); }, {"K1", "-1", "> 0"});
    expect_refusal([] { check_stable({1, 10, 0}); }, {"K3", "0", "> 0"});
    expect_refusal([] { check_stable({kNaN, 10, 1}); }, {"K1", "nan"});
    expect_refusal([] { check_stable({1, kNaN, 1}); }, {"Routh", "nan"});
    expect_refusal([] { (void)design({100, 0.005, 1.0}); }, {"xi", "1", "between 0 and 1"});
    expect_refusal([] { (void)design({100, 0.005, 0}); }, {"xi", "between 0 and 1"});
    expect_refusal([] { (void)design({0, 0.005, 0.7}); }, {"settling time", "0", "more than 0"});
    expect_refusal([] { (void)design({kNaN, 0.005, 0.7}); }, {"settling time", "nan"});
    expect_refusal([] { (void)design({100, 1, 0.7}); }, {"fraction", "1", "between 0 and 1"});
    expect_refusal([] { (void)design({100, -0.1, 0.7}); }, {"fraction", "-0.1"});
    expect_refusal(
        [] {
            check_period(1, design({60, 0.005, 0.7}).sigma, 60);
        },
        {"sample period 1 s is too long for a 60 s levelling: at most 0.57 s"});
    // What is said to be allowed is: 0.6191 s are, 0.62 s are not.
    expect_refusal(
        [] {
            check_period(0.62, design({65, 0.005, 0.7}).sigma, 65);
        },
        {"sample period 0.62 s is too long for a 65 s levelling: at most 0.61 s"});
    // Stable at both ends of the ramp, K1 (1 + K2) = 3.03 against K3 = 4.995 in its middle.
    LevellerSettings ramp;
    ramp.fast = {0.1, 0, 0.09};
    ramp.slow = Gains{1, 9, 9.9};
    check_stable(ramp.fast);
    check_stable(*ramp.slow);
    expect_refusal([&] { Leveller{ramp}; }, {"K1 (1 + K2) > K3"});
}

TEST(LevellingDesign, ALimitThatIsSaidIsOnTheSideThatPasses) {
    EXPECT_EQ(text("%g", at_most(0.61907, 2)), "0.61");
    EXPECT_EQ(text("%g", at_least(0.433403, 3)), "0.434");
    EXPECT_EQ(text("%g", at_least(3 * 0.1, 3)), "0.3");
    EXPECT_EQ(text("%g", at_most(0.57, 2)), "0.57");
    for (const double value : {1e-7, 0.28, 0.29, 0.57, 0.999, 1.0, 99.95, 123456.0}) {
        for (const int digits : {2, 3, 4}) {
            EXPECT_LE(at_most(value, digits), value * (1 + 2 * kRounding)) << digits;
            EXPECT_GE(at_least(value, digits), value * (1 - 2 * kRounding)) << digits;
            EXPECT_NEAR(at_most(value, digits), value, value * std::pow(10, 1 - digits));
            EXPECT_NEAR(at_least(value, digits), value, value * std::pow(10, 1 - digits));
        }
    }
}

TEST(LevellingDesign, SteadyTiltFollowsDriftAndZero) {
    // GIVEN a fast loop with and without its integrator, a drift and an accelerometer zero
    const Gains gains = gains_of(0.05, 0.7);
    for (const double k3 : {gains.k3, 0.0}) {
        const Gains used{gains.k1, gains.k2, k3};
        FastNetwork network{Earth{}};
        constexpr double kDrift = 5 * kDegPerHour;
        constexpr double kZero = 1e-4 * 9.80665;
        constexpr double kPeriod = 0.02;
        double tilt = 0;
        for (int k = 0; k < 50000; ++k) {
            const double rate = network.step(9.80665 * tilt + kZero, 0, used, kPeriod);
            tilt += kPeriod * (kDrift - rate);
        }
        // THEN eqs. 8 and 9
        EXPECT_NEAR(tilt / kRadPerArcmin, steady_tilt(used, kDrift, kZero) / kRadPerArcmin, 1e-6)
            << k3;
        if (k3 > 0) {
            EXPECT_NEAR(tilt / kRadPerArcmin, -0.34378, 1e-5);
            EXPECT_NEAR(network.drift() / kDegPerHour, 5, 1e-6);
        }
    }
}

TEST(LevellingDesign, TheNoiseBudgetIsWhatTheLoopShows) {
    // GIVEN the design of Zha et al. 2019 at 1 Hz and one source of noise at a time
    const double sigma = 0.0088;
    const Gains gains = gains_of(sigma, 0.7);
    struct Source {
        Noise noise;
        double published_arcmin;
    };
    const std::array<Source, 3> sources{{{{0.2, 0, 0}, 0.1074},
                                         {{0, 1e-5 * 9.80665, 0}, 0.00340},
                                         {{0, 0, 0.005 * kRadPerArcmin}, 0.0429}}};
    for (const auto& [noise, published] : sources) {
        const NoiseBudget budget = noise_budget(gains, noise, 1);
        EXPECT_NEAR(budget.total / kRadPerArcmin, published, 2e-3 * published);
        // WHEN it runs for 400 000 correlation times of both channels together
        Scenario run;
        run.loop.fast = gains;
        run.loop.settling_s = 600;
        run.loop.period_s = 1;
        run.loop.noise = noise;
        run.duration_s = 1e6;
        run.seed = 17;
        const SimulatedStart result = simulate(run);
        double sum = 0;
        for (std::size_t k = 10000; k < result.trace.size(); ++k) {
            sum += result.trace[k].tilt[0] * result.trace[k].tilt[0] +
                   result.trace[k].tilt[1] * result.trace[k].tilt[1];
        }
        const double found = std::sqrt(sum / 2 / static_cast<double>(result.trace.size() - 10000));
        // THEN the formula holds within 5 %
        EXPECT_NEAR(found / budget.total, 1, 0.05) << budget.dominant() << ", seed 17";
    }
    // AND what is said of the drift in z, over 200 starts of two channels: 4 sigma of an rms of 400
    Scenario start;
    start.loop.fast = gains_of(0.0525, 0.7);
    start.loop.period_s = 0.1;
    start.loop.noise = {0, 5e-5 * 9.80665, 0.002 * kRadPerArcmin};
    start.duration_s = 300;
    double squares = 0;
    constexpr int kStarts = 200;
    for (start.seed = 1; start.seed <= kStarts; ++start.seed) {
        const Pair drift = simulate(start).drift;
        squares += (drift[0] * drift[0] + drift[1] * drift[1]) / (2 * kStarts);
    }
    const double said = noise_budget(start.loop.fast, start.loop.noise, 0.1).drift;
    EXPECT_NEAR(std::sqrt(squares) / said, 1, 4 / std::sqrt(4.0 * kStarts)) << "seeds 1 to 200";
    const NoiseBudget all = noise_budget(gains, {0.2, 1e-4, 1e-6}, 1);
    EXPECT_STREQ(all.dominant(), "reference velocity");
    EXPECT_NEAR(all.total, std::hypot(all.reference, all.accelerometer, all.gyro), 1e-12);
}

}  // namespace
