#include "tests/plant/drift.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace vibrig::plant {
namespace {

constexpr double kDriftStep = 0.025;

void pass(Drift& drift, double seconds) {
    for (double t = 0; t < seconds - 1e-9; t += kDriftStep) drift.advance(kDriftStep);
}
double change(const Drift& drift, std::size_t gyro, Term term) {
    return drift.coefficients()[gyro][term] - Truth::table2()[gyro][term];
}

TEST(Drift, IsNoneByDefault) {
    Drift drift{Truth{}};
    EXPECT_TRUE(drift.constant());
    drift.begin_dwell();
    pass(drift, 10);
    EXPECT_EQ(drift.coefficients(), Truth::table2());
}

TEST(Drift, StepsAtATimeOrAfterADwellAndStays) {
    Truth truth;
    truth.bias_step_deg_h = {0.1, 0, -0.2};
    truth.unbalance_step_deg_h_g = {{{0.01, 0.02, 0.03}, {}, {0, -0.05, 0}}};
    Drift never(truth);
    pass(never, 20);
    EXPECT_EQ(change(never, 0, kF), 0) << "no time is given";

    truth.step_at_s = 10;
    Drift timed(truth);
    pass(timed, 9.9);
    EXPECT_EQ(change(timed, 0, kF), 0);
    pass(timed, 0.2);
    EXPECT_NEAR(change(timed, 0, kF), 0.1, 1e-15);
    EXPECT_NEAR(change(timed, 2, kF), -0.2, 1e-15);
    EXPECT_NEAR(change(timed, 0, kI), 0.01, 1e-15);
    EXPECT_NEAR(change(timed, 0, kO), 0.02, 1e-15);
    EXPECT_NEAR(change(timed, 0, kS), 0.03, 1e-15);
    EXPECT_NEAR(change(timed, 2, kO), -0.05, 1e-15);
    EXPECT_EQ(change(timed, 2, kOO), 0);

    truth.step_at_s.reset();
    truth.step_after_dwell = 2;
    Drift counted(truth);
    for (int dwell = 1; dwell <= 4; ++dwell) {
        counted.begin_dwell();
        pass(counted, 1);
        EXPECT_NEAR(change(counted, 0, kF), dwell > 2 ? 0.1 : 0, 1e-15) << dwell;
    }
}

TEST(Drift, RampsWithTheHoursAndWithinADwell) {
    Truth truth;
    truth.bias_ramp_deg_h_h = {0.05, 0, 0};
    truth.bias_ramp_in_dwell_deg_h = {0, 0.03, 0};
    truth.unbalance_ramp_deg_h_g_h[1] = {0, 0, 0.2};
    Drift drift(truth);
    pass(drift, 180);
    EXPECT_NEAR(change(drift, 0, kF), 0.05 * 0.05, 1e-12);
    EXPECT_NEAR(change(drift, 1, kS), 0.2 * 0.05, 1e-12);
    EXPECT_EQ(change(drift, 1, kF), 0) << "no dwell has begun";
    drift.begin_dwell();
    EXPECT_EQ(change(drift, 1, kF), 0);
    pass(drift, 50);
    EXPECT_NEAR(change(drift, 1, kF), 0.015, 1e-12);
    drift.begin_dwell();
    EXPECT_EQ(change(drift, 1, kF), 0);
}

TEST(Drift, WalksScattersAndWandersAsMuchAsIsStated) {
    // GIVEN 100 rigs, seeds 1 to 100, of three gyros each
    double walk = 0, scatter = 0, markov = 0, lagged = 0, across = 0;
    const int n = 100;
    for (int seed = 1; seed <= n; ++seed) {
        Truth truth;
        truth.seed = static_cast<std::uint64_t>(seed);
        Truth walking = truth, scattering = truth, wandering = truth;
        walking.bias_walk_deg_h_rt_h = 0.03;
        scattering.bias_scatter_deg_h = 0.02;
        wandering.bias_markov_deg_h = 0.01;
        wandering.bias_markov_s = 30;
        Drift w(walking), s(scattering), m(wandering);
        std::array<double, 3> before{};
        for (std::size_t g = 0; g < 3; ++g) before[g] = change(m, g, kF);
        pass(w, 900);
        pass(m, 30);
        s.begin_dwell();
        pass(s, 1);
        const double first = change(s, 0, kF);
        for (std::size_t g = 0; g < 3; ++g) {
            walk += std::pow(change(w, g, kF), 2);
            scatter += std::pow(change(s, g, kF), 2);
            markov += std::pow(change(m, g, kF), 2);
            lagged += change(m, g, kF) * before[g];
        }
        s.begin_dwell();
        across += first * change(s, 0, kF);
    }
    // THEN the variances are those of theory within 3.29 of their standard errors (99.9 %)
    const double band = 3.29 * std::sqrt(2.0 / (3 * n));
    EXPECT_NEAR(walk / (3 * n) / (0.03 * 0.03 / 4), 1, band);
    EXPECT_NEAR(scatter / (3 * n) / (0.02 * 0.02), 1, band);
    EXPECT_NEAR(markov / (3 * n) / (0.01 * 0.01), 1, band);
    // AND what wanders has forgotten all but 1/e after its time constant, what scatters everything
    EXPECT_NEAR(lagged / (3 * n) / (0.01 * 0.01), std::exp(-1), band);
    EXPECT_NEAR(across / n / (0.02 * 0.02), 0, 3.29 / std::sqrt(n));
}

}  // namespace
}  // namespace vibrig::plant
