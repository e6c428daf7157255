#include "estimator/level/ring_down.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

namespace vibrig::estimator {
namespace {

constexpr double kFloor_g = 0.01;

/// A body on its pads let go at `amplitude_g`, seen along a tilted axis with 1 g of gravity.
std::vector<LoopReading> swing(double hz, double damping, double amplitude_g, double rate_hz,
                               double noise_g, std::uint64_t seed, double seconds = 4) {
    std::mt19937_64 generator(seed);
    std::normal_distribution<double> noise(0, noise_g);
    std::uniform_real_distribution<double> any(0, 2 * std::numbers::pi);
    const double phase = any(generator), omega = 2 * std::numbers::pi * hz;
    std::vector<LoopReading> readings;
    for (int n = 0; n < static_cast<int>(seconds * rate_hz); ++n) {
        LoopReading reading;
        reading.time_s = n / rate_hz;
        const double x =
            amplitude_g * std::exp(-damping * omega * reading.time_s) *
            std::cos(omega * std::sqrt(1 - damping * damping) * reading.time_s + phase);
        reading.force_g = {0.6 * (1 + x) + noise(generator), 0.8 * (1 + x) + noise(generator),
                           noise(generator)};
        readings.push_back(reading);
    }
    return readings;
}

TEST(RingDown, FindsFrequencyAndDampingOfPadsWhereverTheSwingBegins) {
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        for (const double rate_hz : {40.0, 100.0, 1000.0}) {
            for (const double damping : {0.02, 0.05, 0.1}) {
                // GIVEN pads at 9.5 Hz and noise of 0.3 mg, which is 0.1 % of the first swing
                const auto found =
                    ring_down(swing(9.5, damping, 0.33, rate_hz, 3e-4, seed), kFloor_g);
                // THEN both are found to a few percent; the fast rate divides by small differences
                EXPECT_NEAR(found.frequency_hz, 9.5, 0.03 * 9.5) << rate_hz << " " << damping;
                EXPECT_NEAR(found.rate_per_s / (damping * 2 * std::numbers::pi * 9.5), 1, 0.15)
                    << rate_hz << " " << damping;
            }
        }
    }
}

TEST(RingDown, TellsNothingOfRestNoiseOrAFewReadings) {
    EXPECT_EQ(ring_down({}, kFloor_g).rate_per_s, 0);
    EXPECT_EQ(ring_down(swing(9.5, 0.1, 0, 40, 3e-4, 1), kFloor_g).rate_per_s, 0) << "at rest";
    EXPECT_EQ(ring_down(swing(9.5, 0.1, 0.3, 40, 3e-4, 1, 0.15), kFloor_g).rate_per_s, 0)
        << "short";
    // what grows, or goes on, is no decay
    auto steady = swing(9.5, 0, 0.3, 40, 0, 1);
    EXPECT_LT(ring_down(steady, kFloor_g).rate_per_s, 0.05);
    steady[20].force_g[0] = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(ring_down(steady, kFloor_g).rate_per_s, 0);
}

}  // namespace
}  // namespace vibrig::estimator
