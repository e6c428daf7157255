#include "estimator/level/vibration_level.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <string>
#include <utility>

#include "tests/unit/estimator/level/signal.hpp"

namespace vibrig::estimator::testing {
namespace {

/// Streams n samples as the identification does; the first 80 prime the level.
template <class Random>
void stream(VibrationLevel& level, const Signal& signal, int n, Random& random, double lost = 0) {
    std::uniform_real_distribution<double> uniform;
    level.begin(kLevelPeriod_s);
    for (int i = 0; i < n; ++i) {
        if (i == 80) level.prime();
        const double value = signal.at(i * kLevelPeriod_s, random);
        const bool missing = uniform(random) < lost;
        if (i < 80) {
            missing ? level.add_first_missing() : level.add_first(value);
        } else {
            missing ? level.add_missing() : level.add(value);
        }
    }
    if (n <= 80) level.prime();
}

/// Leakage of a line at `frequency`, sampled, into the Hann mean over n samples; upper bound off
/// the main lobe.
double leakage(double frequency, int n) {
    const double bins = std::abs(std::remainder(frequency * kLevelPeriod_s, 1.0)) * n;
    return bins < 2 ? 1.0 : 1.0 / (kPi * bins * (bins * bins - 1));
}

/// Bound of the relative error of kappa from the lines of fu and of its square, and 5 sigma of
/// noise.
double error_bound(const Signal& s, int n) {
    const double a = s.amplitude, e = s.harmonic, f = s.frequency;
    const double mean = a * leakage(f, n) + a * e * leakage(2 * f, n);
    const double square = (2 * a + a * a * e) * leakage(f, n) +
                          (0.5 * a * a + 2 * a * e) * leakage(2 * f, n) +
                          a * a * e * leakage(3 * f, n) + 0.5 * a * a * e * e * leakage(4 * f, n);
    // d kappa = 2 mean of (fu - kappa) v with Hann weights, noise bandwidth 1.5
    const double noise = 5 * 2 * s.noise * std::sqrt(1.5 / n * (s.kappa() - 1) / s.kappa());
    return 1.1 * (square / s.kappa() + 2 * mean) + noise;
}

double measured_error(const Signal& signal, int n, std::mt19937_64& random) {
    VibrationLevel level(10, signal.noise, 15);
    stream(level, signal, n, random);
    return (n > 400 ? level.whole().kappa : level.kappa()) / signal.kappa() - 1;
}

TEST(VibrationLevel, ErrsNoMoreThanTheHannWindowLeaks) {
    const std::uint64_t seed = 20;
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> frequency(4, 36), phase(0, 2 * kPi);
    // GIVEN 6 g with 5 % second harmonic and 1e-4 g of noise at a frequency nobody tells
    for (int n : {80, 400, 4000}) {
        for (int trial = 0; trial < (n > 400 ? 30 : 300); ++trial) {
            Signal signal;
            signal.frequency = frequency(random);
            signal.phase = phase(random);
            signal.phase2 = phase(random);
            // WHEN the level is taken over 2, 10 and 100 s THEN leakage and noise explain its error
            EXPECT_LT(std::abs(measured_error(signal, n, random)), error_bound(signal, n))
                << n << " samples, " << signal.frequency << " Hz";
        }
    }
}

TEST(VibrationLevel, MeetsItsAccuracyAboutTheNominalFrequency) {
    const std::uint64_t seed = 29;
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> frequency(14.6, 15.4), phase(0, 2 * kPi);
    const std::array<std::pair<int, double>, 3> cases{{{80, 1.5e-4}, {400, 3e-5}, {4000, 1.2e-5}}};
    for (const auto& [n, bound] : cases) {
        SCOPED_TRACE(std::to_string(n) + " samples");
        // 2 sigma s sqrt(1.5 / n (kappa - 1) / kappa): after 10 s 1.2e-5 of the 3e-5
        const double noise = 2e-4 * std::sqrt(1.5 / n * 18 / 19);
        double square = 0;
        const int trials = n > 400 ? 20 : 200;
        for (int trial = 0; trial < trials; ++trial) {
            Signal signal;
            signal.frequency = frequency(random);
            signal.phase = phase(random);
            signal.phase2 = phase(random);
            // WHEN there is no noise THEN the worst error is within the bound
            signal.noise = 0;
            const double leaked = measured_error(signal, n, random);
            EXPECT_LT(std::abs(leaked), bound) << signal.frequency << " Hz";
            // AND noise adds what it must, no more: nothing can take it away
            signal.noise = 1e-4;
            const double error = measured_error(signal, n, random);
            const double added = (error - leaked) / noise;
            EXPECT_LT(std::abs(added), 5) << signal.frequency << " Hz";
            square += added * added;
        }
        // 99.9 % quantile of chi-square over its degrees of freedom, 200 and 20
        EXPECT_LT(square / trials, trials == 200 ? 1.338 : 2.266);
    }
}

TEST(VibrationLevel, ClaimsNoFrequencyThatIsNotThere) {
    // GIVEN vibrations near the nominal 15 Hz and far from it
    std::mt19937_64 random(1);
    for (const double hz : {13.0, 15.0, 17.0, 8.7, 10.3, 11.0, 12.4, 18.2}) {
        Signal signal;
        signal.frequency = hz;
        VibrationLevel level(10, signal.noise, 15);
        stream(level, signal, 400, random);
        // THEN one is measured, or none: what the lock-in finds at 15 Hz is not the vibration's
        if (std::abs(hz - 15) <= 2) {
            EXPECT_NEAR(level.frequency_hz(), hz, 1e-3);
        } else {
            EXPECT_TRUE(level.frequency_hz() == 0 || std::abs(level.frequency_hz() - hz) < 1e-3)
                << level.frequency_hz() << " for " << hz;
        }
    }
}

TEST(VibrationLevel, AboutHalfTheSampleRateALineIsWhatItMakesOfTheSamples) {
    // GIVEN a level told 19.5 Hz at 40 Hz, where the sine's column vanishes at 20 Hz
    const std::uint64_t seed = 31;
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> phase(0.2, kPi - 0.2);
    for (int trial = 0; trial < 200; ++trial) {
        for (const double hz : {13.334, 14.2, 16.1, 20.0}) {
            Signal signal;
            signal.frequency = hz;
            signal.phase = phase(random);
            signal.phase2 = phase(random);
            VibrationLevel level(10, signal.noise, 19.5);
            stream(level, signal, 400, random);
            // THEN no line is made up from a large amplitude that the samples do not have, and one
            // that is at half the sample rate is found
            if (hz == 20)
                EXPECT_NEAR(level.frequency_hz(), 20, 0.05) << "phase " << signal.phase;
            else
                EXPECT_EQ(level.frequency_hz(), 0) << "phase " << signal.phase << ", " << hz;
        }
    }
}

/// What is free over 10 s lies beside a multiple of half the sample rate for the windows of 2 s:
/// from the shortest one on that is long enough the level is steady.
TEST(VibrationLevel, IsSteadyFromTheShortestWindowOnBesideWhatIsForbidden) {
    for (const double frequency : {60.2, 60.3, 20.2, 39.5, 40.5, 100.2, 500.2, 19.6, 60.4, 15.0}) {
        const double shortest_s = VibrationLevel::shortest_window_s(frequency, kLevelPeriod_s);
        EXPECT_EQ(shortest_s > 2, frequency != 15) << frequency;
        EXPECT_LE(shortest_s, 10) << frequency;
        EXPECT_FALSE(VibrationLevel::excluded(frequency, kLevelPeriod_s, 10)) << frequency;
        const int first = static_cast<int>(std::ceil(std::max(2.0, shortest_s) / kLevelPeriod_s));
        for (int seed = 1; seed <= 5; ++seed) {
            std::mt19937_64 random(static_cast<std::uint64_t>(seed));
            const Signal signal{.frequency = frequency, .phase = 1.3 * seed, .phase2 = 0.7 * seed};
            VibrationLevel level(10, signal.noise, frequency + 0.01 * (seed - 3));
            level.begin(kLevelPeriod_s);
            double least = 1e9, largest = 0;
            for (int i = 0; i < 1200; ++i) {
                if (i == first) level.prime();
                const double value = signal.at(i * kLevelPeriod_s, random);
                i < first ? level.add_first(value) : level.add(value);
                if (i < first) continue;
                least = std::min(least, level.kappa());
                largest = std::max(largest, level.kappa());
            }
            EXPECT_LT(largest / least, 1 + 2 * error_bound(signal, first))
                << frequency << " Hz, seed " << seed;
            EXPECT_LT(largest / least, 1.1) << "the dwell would be rejected, " << frequency;
        }
    }
    EXPECT_GT(VibrationLevel::shortest_window_s(60.1, kLevelPeriod_s), 10) << "refused";
}

TEST(VibrationLevel, GravityCalibratesTheGain) {
    std::mt19937_64 random(21);
    Signal signal;
    signal.gain = 1.01;
    signal.noise = 0;
    VibrationLevel level(10, 0, 15);
    stream(level, signal, 4000, random);
    EXPECT_NEAR(level.kappa() / signal.kappa(), 1, 3e-5);
    EXPECT_NEAR(level.whole().kappa / signal.kappa(), 1, 1.2e-5);
    EXPECT_NEAR(level.whole().mean_force_g, 1.01, 1e-5);
}

TEST(VibrationLevel, IsOneAtRest) {
    std::mt19937_64 random(22);
    Signal signal;
    signal.amplitude = 0;
    signal.noise = 1e-3;
    VibrationLevel level(10, 1e-3, 15);
    stream(level, signal, 1000, random);
    EXPECT_EQ(level.kappa(), 1.0);
    EXPECT_EQ(level.amplitude_g(), 0.0);
    EXPECT_EQ(level.frequency_hz(), 0.0);
}

TEST(VibrationLevel, LostSamplesDoNotMoveIt) {
    const std::uint64_t seed = 23;
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    // GIVEN 1 % of the samples lost; without care one lost peak is worth 6 % of kappa
    for (double frequency : {15.0, 14.93, 15.07, 12.8}) {
        Signal signal;
        signal.frequency = frequency;
        signal.phase = 0.3;
        signal.phase2 = 1;
        VibrationLevel level(10, 1e-4, frequency > 14 ? 15 : 13);
        // WHEN the level streams
        stream(level, signal, 4000, random, 0.01);
        // THEN it stays within 1e-4
        EXPECT_NEAR(level.kappa() / signal.kappa(), 1, 1e-4) << frequency;
        EXPECT_NEAR(level.whole().kappa / signal.kappa(), 1, 1e-4) << frequency;
    }
}

TEST(VibrationLevel, FollowsAChangeWithinItsWindow) {
    std::mt19937_64 random(24);
    VibrationLevel level(2, 1e-4, 15);
    Signal before, after;
    after.amplitude = 4;
    stream(level, before, 400, random);
    for (int i = 400; i < 480 + 8; ++i) level.add(after.at(i * kLevelPeriod_s, random));
    EXPECT_NEAR(level.kappa() / after.kappa(), 1, 1.5e-4);
}

TEST(VibrationLevel, ExcludesWhatAliasesToZero) {
    EXPECT_FALSE(VibrationLevel::excluded(15, kLevelPeriod_s, 2));
    EXPECT_TRUE(VibrationLevel::excluded(20, kLevelPeriod_s, 10));
    EXPECT_TRUE(VibrationLevel::excluded(20.15, kLevelPeriod_s, 10));
    EXPECT_FALSE(VibrationLevel::excluded(20.25, kLevelPeriod_s, 10));
    EXPECT_TRUE(VibrationLevel::excluded(39.9, kLevelPeriod_s, 10));
    EXPECT_FALSE(VibrationLevel::excluded(39.7, kLevelPeriod_s, 10));
    EXPECT_FALSE(VibrationLevel::excluded(15, 0.001, 10));
    // 3 f = fs: the product of the vibration with its second harmonic
    EXPECT_TRUE(VibrationLevel::excluded(13.34, kLevelPeriod_s, 10, 3));
    EXPECT_FALSE(VibrationLevel::excluded(15, kLevelPeriod_s, 2, 3));
}

}  // namespace
}  // namespace vibrig::estimator::testing
