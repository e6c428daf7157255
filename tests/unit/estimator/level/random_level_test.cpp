#include "estimator/level/random_level.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace vibrig::estimator {
namespace {

/// Flat up to 200 Hz, 3 g rms, of which nothing is known but the profile's realisation in 100 s.
constexpr RandomVibration kFlat{9, 180, 0.01, 200};

RandomLevel sampled(double rms, int n, unsigned seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal(1, rms);
    RandomLevel level;
    for (int i = 0; i < n; ++i) level.add(normal(random));
    return level;
}

TEST(RandomLevel, WeighsSlowSamplesAndProfileByTheirErrors) {
    // 4000 independent samples know 2.2 %, the profile 1 % of gain and 0.75 % of realisation.
    const double by_profile = std::hypot(0.01, 1 / std::sqrt(180.0 * 100));
    const double expected = 1 / std::hypot(std::sqrt(2000.0), 1 / by_profile);
    double square = 0;
    constexpr unsigned kTimes = 300;
    for (unsigned seed = 1; seed <= kTimes; ++seed) {
        // Reality strays from the profile as the profile's error says.
        std::mt19937_64 random(10'000 + seed);
        const double is = 9 * (1 + by_profile * std::normal_distribution<double>()(random));
        const auto level = sampled(std::sqrt(is), 4000, seed).level(kFlat, 0, 0.025, 100);
        EXPECT_NEAR(level.relative_error, expected, 1e-12);
        EXPECT_LT(level.sigmas_apart, 5) << seed;
        square += std::pow((level.mean_square_g2 / is - 1) / level.relative_error, 2);
    }
    // A chi-square of 300: within four of its standard deviations.
    EXPECT_NEAR(square / kTimes, 1, 4 * std::sqrt(2.0 / kTimes));
}

TEST(RandomLevel, FastSamplesAreWhatHappened) {
    const auto level = sampled(3, 40'000, 7).level(kFlat, 0.1, 0.0025, 100);
    EXPECT_EQ(level.relative_error, 0);
    // 9 and the noise's 0.01, which is taken off; the draw itself strays by sqrt(2 / n).
    EXPECT_NEAR(level.mean_square_g2, 8.99, 4 * 9 * std::sqrt(2.0 / 40'000));
    EXPECT_NEAR(level.mean_force_g, 1, 4 * level.mean_force_sigma_g);
    EXPECT_NEAR(level.mean_force_sigma_g, 3 / std::sqrt(40'000.0), 1e-3);
}

TEST(RandomLevel, ALevelThatIsNotTheProfilesIsFarApart) {
    // 1 dB in amplitude is 26 % in the square, ten standard errors.
    const auto level = sampled(3 * std::pow(10, 0.05), 4000, 3).level(kFlat, 0, 0.025, 100);
    EXPECT_NEAR(level.sigmas_apart, 0.2589 / std::hypot(0.02236, 0.01247), 4);
    EXPECT_EQ(RandomLevel().level(kFlat, 0, 0.025, 100).mean_square_g2, 0);
}

}  // namespace
}  // namespace vibrig::estimator
