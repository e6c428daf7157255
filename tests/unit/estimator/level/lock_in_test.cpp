#include "estimator/level/lock_in.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "tests/unit/estimator/level/signal.hpp"

namespace vibrig::estimator::testing {
namespace {

TEST(LockIn, FindsAmplitudePhaseAndFrequency) {
    const std::uint64_t seed = 26;
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    // GIVEN 100 s of 6 g, 0.1 Hz off the nominal frequency, noise 1e-4 g
    constexpr std::size_t n = 4000;
    Signal signal;
    signal.frequency = 15.1;
    signal.phase = 0.7;
    std::vector<double> values(n);
    for (std::size_t i = 0; i < n; ++i)
        values[i] = signal.at(static_cast<double>(i) * kLevelPeriod_s, random);
    const auto valid = std::make_unique<bool[]>(n);
    std::fill_n(valid.get(), n, true);
    // WHEN it is locked to the nominal 15 Hz
    const Vibration v = lock_in({values.data(), valid.get(), n, 0, n, kLevelPeriod_s}, 15);
    // THEN the errors are within 5 sigma of the Cramer-Rao bounds
    EXPECT_NEAR(v.amplitude, 6, 5 * 1e-4 * std::sqrt(2.0 / n));
    EXPECT_NEAR(v.frequency_hz, 15.1,
                5 * 1e-4 * std::sqrt(24.0 / n) / (6 * n * kLevelPeriod_s) / (2 * kPi));
    EXPECT_NEAR(v.phase, 0.7, 5 * 2 * 1e-4 * std::sqrt(2.0 / n) / 6);
    EXPECT_NEAR(v.mean, 1, 5 * 1e-4 / std::sqrt(n));
}

TEST(LockIn, ItsVarianceIsWithinAFifthOfTheCramerRaoBound) {
    const std::uint64_t seed = 30;
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> off(14.9, 15.1), phase(0, 2 * kPi);
    // GIVEN 1500 stretches of 10 s anywhere from 14.9 to 15.1 Hz, no harmonic
    constexpr std::size_t n = 400;
    constexpr int kTrials = 1500;
    std::vector<double> values(n);
    const auto valid = std::make_unique<bool[]>(n);
    std::fill_n(valid.get(), n, true);
    double amplitude = 0, frequency = 0;
    for (int trial = 0; trial < kTrials; ++trial) {
        Signal signal;
        signal.harmonic = 0;
        signal.frequency = off(random);
        signal.phase = phase(random);
        for (std::size_t i = 0; i < n; ++i)
            values[i] = signal.at(static_cast<double>(i) * kLevelPeriod_s, random);
        const Vibration v = lock_in({values.data(), valid.get(), n, 0, n, kLevelPeriod_s}, 15);
        amplitude += std::pow(v.amplitude - 6, 2) / kTrials;
        frequency += std::pow(2 * kPi * (v.frequency_hz - signal.frequency), 2) / kTrials;
    }
    // THEN mean squares over the bounds (known gain; 24 / n of the slope of the phase) stay below
    // 1.2; chance alone moves them by 0.04, one standard deviation
    const double bound_a = std::pow(1e-4, 2) * 2 / n;
    const double bound_w = std::pow(1e-4 / (6 * n * kLevelPeriod_s), 2) * 24 / n;
    RecordProperty("amplitude", std::to_string(amplitude / bound_a));
    RecordProperty("frequency", std::to_string(frequency / bound_w));
    EXPECT_LT(amplitude / bound_a, 1.2);
    EXPECT_LT(frequency / bound_w, 1.2);
}

TEST(LockIn, BlocksHoldWholePeriods) {
    EXPECT_EQ(lock_in_block(15, kLevelPeriod_s, 80), 8U);
    EXPECT_EQ(lock_in_block(15, 0.001, 400), 200U);
    EXPECT_EQ(lock_in_block(10, kLevelPeriod_s, 80), 4U);
}

}  // namespace
}  // namespace vibrig::estimator::testing
