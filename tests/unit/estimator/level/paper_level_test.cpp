#include "estimator/level/paper_level.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/unit/estimator/level/signal.hpp"

namespace vibrig::estimator::testing {
namespace {

TEST(PaperLevel, IsExactOverWholeBlocksAndBlendsItsStart) {
    std::mt19937_64 random(27);
    Signal signal;
    signal.harmonic = signal.noise = 0;
    signal.phase = 0.4;
    PaperLevel level(15, 0.95);
    level.begin(5.0);
    for (int n = 1; n <= 4000; ++n) {
        const double f = signal.at((n - 1) * kLevelPeriod_s, random);
        level.add(100 + (n - 1) * kLevelPeriod_s, f * f);
        // eq. 18 with the exact amplitude of whole blocks
        if (n % 8 == 0) {
            const double expected = std::pow(0.95, n) * 5 + (1 - std::pow(0.95, n)) * 6;
            ASSERT_NEAR(level.amplitude_g(), expected, 1e-9) << n;
        }
    }
    EXPECT_NEAR(level.kappa(), 19, 1e-8);
}

TEST(PaperLevel, WithoutAStartItIsPlainEq13) {
    // GIVEN the crest of the vibration as the first sample
    std::mt19937_64 random(29);
    Signal signal;
    signal.harmonic = signal.noise = 0;
    signal.phase = kPi / 2;
    PaperLevel level(15, 0.95);
    level.begin();
    for (int n = 1; n <= 80; ++n) {
        const double f = signal.at((n - 1) * kLevelPeriod_s, random);
        level.add((n - 1) * kLevelPeriod_s, f * f);
        // THEN whole blocks are exact from the first on: nothing of the first sample is left
        if (n % 8 == 0) {
            ASSERT_NEAR(level.amplitude_g(), 6, 1e-9) << n;
        }
    }
}

TEST(PaperLevel, MissesByWhatThePaperMissesBetweenBlocks) {
    std::mt19937_64 random(28);
    Signal signal;
    signal.harmonic = signal.noise = 0;
    PaperLevel level(15, 0.95);
    level.begin();
    level.add(0, std::pow(signal.at(0, random), 2));
    for (int n = 2; n <= 3999; ++n)
        level.add((n - 1) * kLevelPeriod_s,
                  std::pow(signal.at((n - 1) * kLevelPeriod_s, random), 2));
    const double error = std::abs(level.kappa() / 19 - 1);
    EXPECT_GT(error, 1e-4);
    EXPECT_LT(error, 5e-3);
}

}  // namespace
}  // namespace vibrig::estimator::testing
