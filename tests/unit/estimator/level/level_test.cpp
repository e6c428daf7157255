#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "estimator/filter/kinematics.hpp"
#include "estimator/level/lock_in.hpp"
#include "estimator/level/paper_level.hpp"
#include "estimator/level/vibration_level.hpp"

namespace vibrig::estimator::testing {
namespace {

constexpr double kPeriod = 0.025;

/// K (1 + a (sin(wt + p) + e sin(2wt + p2))) + noise at 40 Hz.
struct Signal {
    double amplitude = 6, frequency = 15, harmonic = 0.05, noise = 1e-4, gain = 1, phase = 0,
           phase2 = 0;

    [[nodiscard]] double kappa() const {
        return 1 + 0.5 * amplitude * amplitude * (1 + harmonic * harmonic);
    }
    template <class Random>
    double at(double t, Random& random) const {
        std::normal_distribution<double> gauss(0, noise);
        const double wt = 2 * kPi * frequency * t;
        return gain *
                   (1 + amplitude * (std::sin(wt + phase) + harmonic * std::sin(2 * wt + phase2))) +
               gauss(random);
    }
};

/// Streams n samples as the identification does; the first 80 prime the level.
template <class Random>
void stream(VibrationLevel& level, const Signal& signal, int n, Random& random, double lost = 0) {
    std::uniform_real_distribution<double> uniform;
    level.begin(kPeriod);
    for (int i = 0; i < n; ++i) {
        if (i == 80) level.prime();
        const double value = signal.at(i * kPeriod, random);
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
    const double bins = std::abs(std::remainder(frequency * kPeriod, 1.0)) * n;
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
    for (int i = 400; i < 480 + 8; ++i) level.add(after.at(i * kPeriod, random));
    EXPECT_NEAR(level.kappa() / after.kappa(), 1, 1.5e-4);
}

TEST(VibrationLevel, ExcludesWhatAliasesToZero) {
    EXPECT_FALSE(VibrationLevel::excluded(15, kPeriod, 2));
    EXPECT_TRUE(VibrationLevel::excluded(20, kPeriod, 10));
    EXPECT_TRUE(VibrationLevel::excluded(20.15, kPeriod, 10));
    EXPECT_FALSE(VibrationLevel::excluded(20.25, kPeriod, 10));
    EXPECT_TRUE(VibrationLevel::excluded(39.9, kPeriod, 10));
    EXPECT_FALSE(VibrationLevel::excluded(39.7, kPeriod, 10));
    EXPECT_FALSE(VibrationLevel::excluded(15, 0.001, 10));
    // 3 f = fs: the product of the vibration with its second harmonic
    EXPECT_TRUE(VibrationLevel::excluded(13.34, kPeriod, 10, 3));
    EXPECT_FALSE(VibrationLevel::excluded(15, kPeriod, 2, 3));
}

TEST(GrowingHann, IsExactForAnyLength) {
    std::mt19937_64 random(25);
    std::normal_distribution<double> gauss;
    for (std::size_t n : {1UL, 2UL, 7UL, 80UL, 2047UL, 2048UL, 2049UL, 40001UL, 123456UL}) {
        GrowingHann growing;
        std::vector<double> values(n);
        for (double& v : values) {
            v = 1 + gauss(random);
            growing.add(v);
        }
        long double w = 0, s = 0, q = 0;
        for (std::size_t i = 0; i < n; ++i) {
            const long double weight = std::pow(
                std::sin(static_cast<long double>(kPi) * (static_cast<long double>(i) + 0.5L) /
                         static_cast<long double>(n)),
                2);
            w += weight;
            s += weight * values[i];
            q += weight * values[i] * values[i];
        }
        EXPECT_NEAR(growing.means().mean, static_cast<double>(s / w), 1e-7) << n;
        EXPECT_NEAR(growing.means().mean_square, static_cast<double>(q / w), 1e-7) << n;
        const HannMeans direct = HannWindow(n).means(values.data(), n, 0, n);
        EXPECT_NEAR(direct.mean, static_cast<double>(s / w), 1e-10) << n;
    }
}

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
        values[i] = signal.at(static_cast<double>(i) * kPeriod, random);
    const auto valid = std::make_unique<bool[]>(n);
    std::fill_n(valid.get(), n, true);
    // WHEN it is locked to the nominal 15 Hz
    const Vibration v = lock_in({values.data(), valid.get(), n, 0, n, kPeriod}, 15);
    // THEN the errors are within 5 sigma of the Cramer-Rao bounds
    EXPECT_NEAR(v.amplitude, 6, 5 * 1e-4 * std::sqrt(2.0 / n));
    EXPECT_NEAR(v.frequency_hz, 15.1,
                5 * 1e-4 * std::sqrt(24.0 / n) / (6 * n * kPeriod) / (2 * kPi));
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
            values[i] = signal.at(static_cast<double>(i) * kPeriod, random);
        const Vibration v = lock_in({values.data(), valid.get(), n, 0, n, kPeriod}, 15);
        amplitude += std::pow(v.amplitude - 6, 2) / kTrials;
        frequency += std::pow(2 * kPi * (v.frequency_hz - signal.frequency), 2) / kTrials;
    }
    // THEN mean squares over the bounds (known gain; 24 / n of the slope of the phase) stay below
    // 1.2; chance alone moves them by 0.04, one standard deviation
    const double bound_a = std::pow(1e-4, 2) * 2 / n;
    const double bound_w = std::pow(1e-4 / (6 * n * kPeriod), 2) * 24 / n;
    RecordProperty("amplitude", std::to_string(amplitude / bound_a));
    RecordProperty("frequency", std::to_string(frequency / bound_w));
    EXPECT_LT(amplitude / bound_a, 1.2);
    EXPECT_LT(frequency / bound_w, 1.2);
}

TEST(LockIn, BlocksHoldWholePeriods) {
    EXPECT_EQ(lock_in_block(15, kPeriod, 80), 8U);
    EXPECT_EQ(lock_in_block(15, 0.001, 400), 200U);
    EXPECT_EQ(lock_in_block(10, kPeriod, 80), 4U);
}

TEST(PaperLevel, IsExactOverWholeBlocksAndBlendsItsStart) {
    std::mt19937_64 random(27);
    Signal signal;
    signal.harmonic = signal.noise = 0;
    signal.phase = 0.4;
    PaperLevel level(15, 0.95);
    level.begin(5.0);
    for (int n = 1; n <= 4000; ++n) {
        const double f = signal.at((n - 1) * kPeriod, random);
        level.add(100 + (n - 1) * kPeriod, f * f);
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
        const double f = signal.at((n - 1) * kPeriod, random);
        level.add((n - 1) * kPeriod, f * f);
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
        level.add((n - 1) * kPeriod, std::pow(signal.at((n - 1) * kPeriod, random), 2));
    const double error = std::abs(level.kappa() / 19 - 1);
    EXPECT_GT(error, 1e-4);
    EXPECT_LT(error, 5e-3);
}

}  // namespace
}  // namespace vibrig::estimator::testing
