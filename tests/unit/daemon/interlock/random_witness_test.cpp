#include "daemon/interlock/random_witness.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "daemon/interlock/interlock.hpp"
#include "daemon/rt/real_clock.hpp"
#include "tests/plant/random_drive.hpp"
#include "tests/unit/daemon/interlock/fake_shaker.hpp"

// The whole table of the interlock under a random vibration, sample by sample.
namespace vibrig::rt {
namespace {

constexpr double kLevel_g = 3;         // rms
constexpr double kThrough = 0.7;       // rms at the platform over rms at the table
constexpr double kBandwidth_hz = 117;  // of the truck type
constexpr double kAcross = 0.1;        // of the motion along the vertical: well below cross_axis

/// A table that plays a profile of the truck's type, with a platform that stands on it.
class Shaken {
  public:
    Shaken(double sample_hz, std::uint64_t seed)
        : period_(static_cast<drivers::Time>(1e9 / sample_hz)),
          white_(seed),
          drive_(seed, 1 / sample_hz),
          slow_(sample_hz < 100) {
        if (!slow_) drive_.shape({1, {{10, 0.015}, {40, 0.015}, {500, 0.00015}}});
        Interlock::Limits limits{12};
        limits.witness.sample_period = period_;
        limits.witness.count_g = {1e-4, 1e-4, 1e-4, 1e-4};
        limits.random = {{sample_hz, kBandwidth_hz, kBandwidth_hz}};
        interlock_ = std::make_unique<Interlock>(shaker_, *control_, limits);
        sample_.quality.fill(drivers::Quality::good);
        platform_.loop_closed = true;
        sample_.time = drivers::kSecond;
        interlock_->command(0, {0, 0, 0});
        interlock_->guard(Guard::excitation);
        say(0, kLevel_g, 2);
    }

    /// The level is commanded, and the campaign does not take the level for reached yet.
    void say(double from_g, double to_g, double ramp_s) {
        Ramp ramp;
        ramp.start_g = from_g;
        ramp.target_g = to_g;
        ramp.begin = sample_.time;
        ramp.duration = drivers::from_seconds(ramp_s);
        ramp.armed_g = kLevel_g;
        ramp.raw_up = {0, 1, 0};
        ramp.transmission = kThrough;
        ramp.random = 1;
        interlock_->ramp(ramp);
    }
    void at_level() { interlock_->command(kLevel_g, {0, 0, 0}); }

    /// Seconds until it trips, `most_s` at most; negative: it does not.
    double run(double most_s, double level = 1) {
        for (double t = 0; t < most_s; t += drivers::to_seconds(period_)) {
            tick(level);
            if (interlock_->tripped() != Trip::none) return t;
        }
        return -1;
    }
    /// A ramp of 2 s and one more at level.
    void climb() {
        for (double share = 0; share < 1; share += drivers::to_seconds(period_) / 2) tick(share);
        at_level();
        ASSERT_LT(run(1), 0) << text();
    }
    [[nodiscard]] std::string text() const { return interlock_->text_of(interlock_->latched()); }
    /// By the bands, or by a single value beyond six sigma of what was commanded.
    [[nodiscard]] bool too_much() const {
        return (tripped() == Trip::amplitude_witness &&
                text().find(" g rms at the table, 3 g commanded") != std::string::npos) ||
               tripped() == Trip::over_amplitude;
    }
    [[nodiscard]] Trip tripped() const { return interlock_->tripped(); }
    [[nodiscard]] Interlock& interlock() { return *interlock_; }

    double tilt_rad = 0;
    bool table_dead = false, platform_stuck = false;

  private:
    double next() {
        if (slow_) return normal_(white_);
        if (at_ == block_.size()) {
            drive_.next(block_);
            at_ = 0;
        }
        return block_[at_++].in_phase;
    }
    void tick(double level) {
        sample_.time += period_;
        platform_.time = sample_.time;
        const double table = table_dead ? 0 : level * kLevel_g * next();
        const double platform = kThrough * table;
        sample_.table_accel = table;
        const double c = std::cos(tilt_rad), s = std::sin(tilt_rad);
        const double across = kAcross * platform * (slow_ ? normal_(white_) : 1);
        if (!platform_stuck) sample_.force = {across - s, c * (1 + platform), 0};
        interlock_->check(sample_, platform_);
    }

    drivers::Time period_;
    std::mt19937_64 white_;
    std::normal_distribution<double> normal_;
    plant::RandomDrive drive_;
    bool slow_;
    std::vector<plant::Shake> block_ = std::vector<plant::Shake>(256);
    std::size_t at_ = block_.size();
    RealClock clock_;
    std::unique_ptr<drivers::Waiter> control_ = clock_.make_waiter();
    FakeShaker shaker_;
    drivers::Sample sample_;
    drivers::PlatformStatus platform_;
    std::unique_ptr<Interlock> interlock_;
};

class RandomWitnessAt : public testing::TestWithParam<double> {};

TEST_P(RandomWitnessAt, HalfAnHourAtLevelTripsNothing) {
    const int seeds = GetParam() > 100 ? 2 : 20;
    for (int seed = 1; seed <= seeds; ++seed) {
        Shaken rig(GetParam(), static_cast<std::uint64_t>(seed));
        rig.climb();
        ASSERT_LT(rig.run(1800), 0) << rig.text() << ", seed " << seed;
        // Nor does the way down.
        rig.interlock().command(0, {0, 0, 0});
        rig.say(kLevel_g, 0, 2);
        for (double level = 1; level > 0; level -= 0.1) ASSERT_LT(rig.run(0.2, level), 0);
        EXPECT_EQ(rig.tripped(), Trip::none) << rig.text() << ", seed " << seed;
    }
}

TEST_P(RandomWitnessAt, SixDecibelsTooMuchAreFoundInTheirTime) {
    const bool slow = GetParam() < 100;
    int in_time = 0;
    for (int seed = 1; seed <= 20; ++seed) {
        Shaken rig(GetParam(), static_cast<std::uint64_t>(seed));
        rig.climb();
        const double took_s = rig.run(5, 2);
        ASSERT_GE(took_s, 0) << "seed " << seed;
        EXPECT_TRUE(rig.too_much()) << rig.text();
        // 24 values do not know 6 dB for sure; 117 do.
        EXPECT_LE(took_s, slow ? 2.95 : 0.6) << "seed " << seed;
        in_time += took_s <= 0.6;
    }
    EXPECT_GE(in_time, slow ? 5 : 20);
}

TEST_P(RandomWitnessAt, SixDecibelsTooMuchAreFoundOnTheRampToo) {
    for (int seed = 1; seed <= 20; ++seed) {
        Shaken rig(GetParam(), static_cast<std::uint64_t>(seed));
        EXPECT_GE(rig.run(5, 2), 0) << "seed " << seed;
        EXPECT_TRUE(rig.too_much()) << rig.text();
    }
}

TEST_P(RandomWitnessAt, ATableThatStandsIsFoundWithinItsWindow) {
    Shaken rig(GetParam(), 3);
    rig.climb();
    rig.table_dead = true;
    const double took_s = rig.run(10);
    EXPECT_GE(took_s, 0);
    EXPECT_LE(took_s, 190 / 40.0 + 0.1);
    EXPECT_EQ(rig.tripped(), Trip::amplitude_witness) << rig.text();
}

TEST_P(RandomWitnessAt, AnAccelerometerThatStandsStillIsStuck) {
    int stuck = 0;
    constexpr int kTries = 20;
    for (int seed = 1; seed <= kTries; ++seed) {
        Shaken rig(GetParam(), static_cast<std::uint64_t>(seed));
        rig.climb();
        rig.platform_stuck = true;
        const double took_s = rig.run(10);
        ASSERT_GE(took_s, 0) << "seed " << seed;
        EXPECT_LE(took_s, 1.5) << "seed " << seed;
        // One that stands at a crest is beyond its band before that.
        const bool beyond = rig.tripped() == Trip::amplitude_witness &&
                            rig.text().find("platform") != std::string::npos;
        EXPECT_TRUE(rig.tripped() == Trip::stuck || beyond) << rig.text() << ", seed " << seed;
        stuck += rig.tripped() == Trip::stuck;
    }
    // A value beyond the 3 dB of a band is one of seven, another one within it falls below.
    EXPECT_GE(stuck, kTries / 4);
}

TEST_P(RandomWitnessAt, APlatformThatTiltsIsFoundAllTheSame) {
    for (int seed = 1; seed <= 5; ++seed) {
        Shaken rig(GetParam(), static_cast<std::uint64_t>(seed));
        rig.climb();
        ASSERT_LT(rig.run(120), 0) << rig.text();  // the vertical is known
        rig.tilt_rad = 0.6;
        EXPECT_GE(rig.run(60), 0) << "seed " << seed;
        EXPECT_TRUE(rig.tripped() == Trip::tilt || rig.tripped() == Trip::amplitude_witness)
            << rig.text();
    }
}

INSTANTIATE_TEST_SUITE_P(Rates, RandomWitnessAt, testing::Values(40, 2000), [](const auto& one) {
    return std::to_string(static_cast<int>(one.param));
});

TEST(RandomWitness, HasNoRateThatNobodyStated) {
    const RandomWitness::Settings unstated{.table_bandwidth_hz = 117, .platform_bandwidth_hz = 117};
    EXPECT_THROW(RandomWitness{unstated}, std::invalid_argument);
}

TEST(RandomWitness, TheMeanThatShowsGravityFollowsFromTheLevel) {
    const RandomWitness slow({40, 117, 117}), fast({2000, 117, 117});
    // (16 rms)^2 values: 1024 of 2 g, over 2 tau n'.
    EXPECT_DOUBLE_EQ(slow.time_for_tilt_s(2).value(), 1024 / 80.0);
    EXPECT_DOUBLE_EQ(fast.time_for_tilt_s(2).value(), 1024 / (2 * 234.0));
    EXPECT_DOUBLE_EQ(slow.time_for_tilt_s(0.3).value(), 2);
    EXPECT_FALSE(slow.time_for_tilt_s(5).has_value());
    EXPECT_TRUE(fast.fast());
    EXPECT_FALSE(slow.fast()) << "the controller's own bands are needed beside 40 values a second";
}

}  // namespace
}  // namespace vibrig::rt
