#include "daemon/interlock/random_bands.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "tests/plant/random_drive.hpp"
#include "tests/plant/shaker_profile.hpp"

namespace vibrig::rt {
namespace {

using Finding = RandomBands::Finding;
using Bands = RandomBands;

constexpr int kSeeds = 20;
constexpr double kHalfHour_s = 1800;

/// A profile's values at a rate: by the simulated rig's drive, whose steps are 8 kHz or the rate.
class Values {
  public:
    Values(const plant::ShakerProfile& profile, double sample_hz, std::uint64_t seed)
        : white_(seed), drive_(seed, 1 / sample_hz), slow_(sample_hz < 100) {
        if (!slow_) drive_.shape(profile);
    }
    /// Of rms 1. Below twice the profile's lowest frequencies values are independent.
    double next() {
        if (slow_) return normal_(white_);
        if (at_ == block_.size()) {
            drive_.next(block_);
            at_ = 0;
        }
        return block_[at_++].in_phase;
    }

  private:
    std::mt19937_64 white_;
    std::normal_distribution<double> normal_;
    plant::RandomDrive drive_;
    bool slow_;
    std::vector<plant::Shake> block_ = std::vector<plant::Shake>(256);
    std::size_t at_ = block_.size();
};

/// 10 to 500 Hz, of a truck's type: B_e 117 Hz.
plant::ShakerProfile truck() { return {1, {{10, 0.015}, {40, 0.015}, {500, 0.00015}}}; }

Bands::Settings settings_of(double sample_hz) { return {sample_hz, 117, 1}; }

/// Seconds until `level` (amplitude) is found, after a minute at its level; 0: found before.
double seconds_to_trip(double sample_hz, double level, std::uint64_t seed, double most_s,
                       Finding& what) {
    Values values(truck(), sample_hz, seed);
    Bands bands(settings_of(sample_hz));
    for (int i = 0; i < static_cast<int>(60 * sample_hz); ++i) {
        if (bands.add(values.next()) != Finding::none) return 0;
    }
    for (int i = 1; i <= static_cast<int>(most_s * sample_hz); ++i) {
        what = bands.add(level * values.next());
        if (what != Finding::none) return i / sample_hz;
    }
    return most_s + 1;
}

TEST(RandomBands, WindowsFollowFromTheIndependentValues) {
    const Bands slow(settings_of(40)), fast(settings_of(2000)), narrow({2000, 10, 1});
    // 40 values a second: the 22, 117 and 190 of theory.
    EXPECT_DOUBLE_EQ(slow.rules()[0].window_s, 0.6);
    EXPECT_DOUBLE_EQ(slow.rules()[1].window_s, 117 / 40.0);
    EXPECT_DOUBLE_EQ(slow.rules()[2].window_s, 190 / 40.0);
    // However fast, 2 B_e = 234 of them are independent.
    EXPECT_DOUBLE_EQ(fast.rules()[0].window_s, 0.6);
    EXPECT_NEAR(fast.rules()[0].independent, 140.4, 1e-9);
    EXPECT_DOUBLE_EQ(fast.rules()[1].window_s, 0.6);
    EXPECT_DOUBLE_EQ(fast.rules()[2].window_s, 1);
    EXPECT_EQ(fast.rules()[0].values, 1200U);
    EXPECT_DOUBLE_EQ(narrow.rules()[0].window_s, 22 / 20.0);
    // Over so few values the thresholds are the decibels themselves, within what 22 values round.
    EXPECT_NEAR(Bands::threshold(6, 22), std::pow(10, 0.6), 1e-9);
    EXPECT_NEAR(Bands::threshold(3, 117), std::pow(10, 0.3), 0.03);
    EXPECT_NEAR(Bands::threshold(-3, 190), std::pow(10, -0.3), 0.03);
}

TEST(RandomBands, HalfAnHourAtItsLevelDoesNotTrip) {
    for (const double hz : {40.0, 2000.0}) {
        for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
            Values values(truck(), hz, seed);
            Bands bands(settings_of(hz));
            const auto count = static_cast<int>(kHalfHour_s * hz);
            int found = 0;
            for (int i = 0; i < count; ++i) found += bands.add(values.next()) != Finding::none;
            EXPECT_EQ(found, 0) << hz << " values/s, seed " << seed;
        }
    }
}

TEST(RandomBands, SixDecibelsTooMuchAreFoundIn600Milliseconds) {
    for (std::uint64_t seed = 1; seed <= 10 * kSeeds; ++seed) {
        Finding what = Finding::none;
        const double s = seconds_to_trip(2000, std::pow(10, 0.3), seed, 5, what);
        EXPECT_GT(s, 0);
        EXPECT_LE(s, 0.6) << "seed " << seed;
    }
}

/// 24 values cannot know it for sure: of a mean of 24 squares the threshold of one false trip in
/// 1e9 looks is 5.9 dB. So a bus of 40/s needs the controller's own bands beside it.
TEST(RandomBands, AtFortyValuesASecondSixDecibelsTakeASecondOrTwo) {
    int within = 0;
    constexpr int kCount = 10 * kSeeds;
    for (std::uint64_t seed = 1; seed <= kCount; ++seed) {
        Finding what = Finding::none;
        const double s = seconds_to_trip(40, std::pow(10, 0.3), seed, 10, what);
        EXPECT_GT(s, 0);
        within += s <= 0.6;
        // 117 values, of which half are enough for 3 dB: half of their window, and as much again.
        EXPECT_LE(s, 117 / 40.0) << "seed " << seed;
    }
    // P(chi-square of 24 above 24 times the threshold, over 4), or sooner.
    EXPECT_GT(within, kCount * 0.4);
    EXPECT_LT(within, kCount * 0.8);
}

TEST(RandomBands, ThreeDecibelsTooMuchOrTooLittleAreFoundInTheirWindows) {
    for (const double hz : {40.0, 2000.0}) {
        const Bands bands(settings_of(hz));
        for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
            Finding what = Finding::none;
            const double up = seconds_to_trip(hz, std::pow(10, 0.2), seed, 20, what);
            EXPECT_GT(up, 0);
            EXPECT_LE(up, 2 * bands.rules()[1].window_s) << hz << ", seed " << seed;
            const double down = seconds_to_trip(hz, std::pow(10, -0.2), seed, 20, what);
            EXPECT_GT(down, 0);
            EXPECT_EQ(what, Finding::below);
            EXPECT_LE(down, 2 * bands.rules()[2].window_s) << hz << ", seed " << seed;
        }
    }
}

TEST(RandomBands, ARightLevelIsShownInsideItsBands) {
    // GIVEN 20 rigs at their level, a minute each, 40 values a second
    int looks = 0, beyond_by_24_values = 0;
    for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
        Values values(truck(), 40, seed);
        Bands bands(settings_of(40));
        std::vector<double> squares;
        for (int i = 0; i < 60 * 40; ++i) {
            const double value = values.next();
            static_cast<void>(bands.add(value));
            squares.push_back(value * value);
            if (squares.size() < bands.rules()[1].values) continue;
            // THEN what is shown is within 3 dB: a mean of 117 squares is not, once in 8e5
            EXPECT_GT(bands.ratio(), std::pow(10, -0.3)) << "seed " << seed << ", " << i;
            EXPECT_LT(bands.ratio(), std::pow(10, 0.3)) << "seed " << seed << ", " << i;
            ++looks;
            beyond_by_24_values +=
                std::accumulate(squares.end() - 24, squares.end(), 0.0) / 24 < std::pow(10, -0.3)
                    ? 1
                    : 0;
        }
    }
    // AND that of the shortest window would not be: P(chi-square of 24 below 12), 2.0 %, of 1900
    // windows that do not overlap within 0.012, 3.7 of its standard deviations
    EXPECT_NEAR(beyond_by_24_values / static_cast<double>(looks), 0.020, 0.012) << looks;
}

TEST(RandomBands, NoNumberIsWrongAndBeginForgets) {
    Bands bands(settings_of(40));
    EXPECT_EQ(bands.add(std::nan("")), Finding::far_above);
    for (int i = 0; i < 30; ++i) static_cast<void>(bands.add(10));
    EXPECT_EQ(bands.add(10), Finding::far_above);
    EXPECT_NEAR(bands.ratio(), 100, 1e-9);
    bands.begin();
    EXPECT_EQ(bands.add(10), Finding::none);
    EXPECT_EQ(bands.ratio(), 0);
    EXPECT_THROW(Bands({40, 0, 1}), std::invalid_argument);
    EXPECT_THROW(Bands({.bandwidth_hz = 117, .mean_square = 1}), std::invalid_argument);
    EXPECT_THROW(Bands({40, 100, 0}), std::invalid_argument);
}

}  // namespace
}  // namespace vibrig::rt
