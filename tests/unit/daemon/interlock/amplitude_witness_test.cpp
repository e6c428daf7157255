// The table does what was commanded, as the accelerometers see it: the simulated rig with a
// controller that lies, and with everything that is no reason to stop.
#include "daemon/interlock/amplitude_witness.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <optional>
#include <random>
#include <string>

#include "daemon/interlock/interlock.hpp"
#include "daemon/rt/real_clock.hpp"
#include "proto/register_map.hpp"
#include "tests/plant/rig.hpp"
#include "tests/unit/daemon/interlock/fake_shaker.hpp"

namespace vibrig::rt {
namespace {

using drivers::Channel;
using drivers::kSecond;
using drivers::Time;

constexpr double kCount_g = 3.814697265625e-6;
constexpr double kArmed_g = 9;

plant::Truth quiet_truth() {
    plant::Truth truth;
    truth.seed = 7;
    return truth;
}

/// The interlock as the daemon has it, on the simulated rig; 40 samples a second.
struct WitnessedRig {
    plant::Truth truth;
    plant::Rig rig{truth};
    RealClock clock;
    std::unique_ptr<drivers::Waiter> control = clock.make_waiter();
    FakeShaker shaker;
    Interlock interlock;
    drivers::Sample sample;
    drivers::PlatformStatus platform;
    double armed_g = kArmed_g, at_g = 0, transmission;
    bool transmission_known = true;
    std::optional<std::size_t> stuck{};  ///< accelerometer x, y, z or the table's
    bool frozen = false;                 ///< all of them show their last values for ever
    std::function<void(drivers::Sample&)> spoil{};
    double largest_off_db = 0;  ///< of what both witnesses show while steady

    explicit WitnessedRig(const plant::Truth& t = quiet_truth(), double configured = 2.0 / 3)
        : truth(t), interlock(shaker, *control, limits(t, configured)), transmission(configured) {
        sample.quality.fill(drivers::Quality::good);
        platform.loop_closed = true;
        for (int n = 0; n < 4; ++n) tick();
    }

    static Interlock::Limits limits(const plant::Truth& t, double configured) {
        Interlock::Limits limits;
        limits.table_g = 12;
        limits.witness.frequency_hz = t.frequency_hz;
        limits.witness.sample_period = drivers::from_seconds(1 / t.sample_rate_hz);
        limits.witness.count_g.fill(kCount_g);
        limits.transmission = configured;
        return limits;
    }

    [[nodiscard]] Time now() const { return kSecond + 1000 * rig.time_us(); }
    [[nodiscard]] Trip trip() const { return interlock.tripped(); }
    [[nodiscard]] std::string text() const { return interlock.text_of(interlock.latched()); }

    void tick() {
        rig.advance();
        const auto& readings = rig.readings();
        for (std::size_t i = 0; i < 3; ++i) {
            sample.angle[i] = readings.encoder_deg[i] * std::numbers::pi / 180;
            if (stuck != i && !frozen) sample.force[i] = readings.raw_g[i];
        }
        if (stuck != 3U && !frozen) sample.table_accel = readings.table_g;
        sample.time = platform.time = now();
        if (spoil) spoil(sample);
        interlock.check(sample, platform);
    }
    void wait(double seconds) {
        for (int n = 0; n < seconds * 40 && trip() == Trip::none; ++n) tick();
    }
    void position(const std::array<double, 3>& deg) {
        rig.slew_to({deg[0], deg[1], deg[2]});
        for (int n = 0; n < 40 * 80 && (n < 4 || rig.gimbals().slewing()); ++n) tick();
        rig.release();
    }
    void write(std::size_t address, std::initializer_list<std::uint16_t> values) {
        EXPECT_EQ(rig.shaker().write(address, std::span(values.begin(), values.size())),
                  plant::ShakerController::Answer::accepted);
    }
    /// The registers are written `late_s` after the interlock has the ramp.
    void ask(double table_g, double ramp_s, double late_s = 0) {
        const auto up = rig.platform().up_in_platform();
        interlock.command(0, degrees());
        interlock.ramp({at_g,
                        table_g,
                        now(),
                        drivers::from_seconds(ramp_s),
                        armed_g,
                        transmission_known,
                        {up[0], up[1], up[2]}});
        shaker.writing = late_s > 0;
        wait(late_s);
        shaker.writing = false;
        const auto raw = static_cast<std::uint32_t>(std::llround(table_g * 1e4));
        write(2, {static_cast<std::uint16_t>(raw >> 16), static_cast<std::uint16_t>(raw),
                  static_cast<std::uint16_t>(std::llround(ramp_s * 100)), 1});
        at_g = table_g;
    }
    [[nodiscard]] std::array<double, 3> degrees() const {
        std::array<double, 3> deg{};
        for (std::size_t i = 0; i < 3; ++i) deg[i] = rig.readings().encoder_deg[i];
        return deg;
    }
    /// Up to a level that is read back as reached, as an echo does.
    void shake(double table_g, double ramp_s = 2, double late_s = 0) {
        interlock.guard(Guard::excitation);
        ask(table_g, ramp_s, late_s);
        wait(ramp_s + 0.2);
        interlock.command(table_g, degrees());
    }
    void rest(double ramp_s = 2, double late_s = 0) {
        ask(0, ramp_s, late_s);
        wait(ramp_s + 0.5);
        write(5, {0});
        interlock.guard(Guard::armed);
        wait(1);
    }
    /// Ticks until it trips, as seconds; negative: it does not within `at_most`.
    double until_trip(double at_most_s) {
        const Time from = now();
        wait(at_most_s);
        return trip() == Trip::none ? -1 : drivers::to_seconds(now() - from);
    }
};

TEST(AmplitudeWitness, ATableThatDoesTwiceWhatWasCommandedStopsWithinHalfASecondOfTheLevelArmed) {
    auto truth = quiet_truth();
    truth.shaker_lies.amplitude_scaled = 2;
    WitnessedRig rig(truth);
    rig.rig.shaker().lie(truth.shaker_lies);
    rig.armed_g = 5;
    rig.interlock.guard(Guard::excitation);
    rig.ask(5, 2);
    Time over = 0;
    while (rig.trip() == Trip::none && rig.now() < 6 * kSecond) {
        rig.tick();
        if (over == 0 && rig.rig.shaker().amplitude_g() > 5 * AmplitudeWitness::kDecibel)
            over = rig.now();
    }
    EXPECT_EQ(rig.trip(), Trip::over_armed) << rig.text();
    ASSERT_NE(over, 0);
    EXPECT_LE(rig.now() - over, kSecond / 2);
    EXPECT_LT(rig.rig.shaker().amplitude_g(), 8) << "long before 10 g";
    EXPECT_NE(rig.text().find("5 g armed"), std::string::npos) << rig.text();
}

TEST(AmplitudeWitness, ADeadTableStopsWhileItIsStillToBeRamped) {
    auto truth = quiet_truth();
    WitnessedRig rig(truth);
    rig.rig.shaker().lie({.readback_echo = true, .dead_table = true});
    rig.interlock.guard(Guard::excitation);
    rig.ask(5, 2);
    const double taken = rig.until_trip(3);
    EXPECT_EQ(rig.trip(), Trip::amplitude_witness) << rig.text();
    // 0.3 g are due 0.12 s after the beginning: half a second of command, half a second to stop
    EXPECT_GT(taken, 0.5);
    EXPECT_LE(taken, 0.12 + 0.5 + 0.5);
}

struct Later {
    const char* name;
    plant::ShakerLies lie;
    Trip trip;
};
void PrintTo(const Later& one, std::ostream* out) { *out << one.name; }

class WhileItShakes : public testing::TestWithParam<Later> {};

TEST_P(WhileItShakes, WhatDisagreesFromNowOnStopsWithinHalfASecond) {
    WitnessedRig rig;
    rig.shake(5);
    rig.wait(3);
    ASSERT_EQ(rig.trip(), Trip::none) << rig.text();
    rig.rig.shaker().lie(GetParam().lie);
    const double taken = rig.until_trip(3);
    EXPECT_EQ(rig.trip(), GetParam().trip) << rig.text();
    EXPECT_GT(taken, 0);
    EXPECT_LE(taken, 0.5);
}

INSTANTIATE_TEST_SUITE_P(
    Every, WhileItShakes,
    testing::Values(
        Later{"twice", {.amplitude_scaled = 2}, Trip::amplitude_witness},
        Later{"half", {.amplitude_scaled = 0.5}, Trip::amplitude_witness},
        Later{"a_decibel_and_a_half_more", {.amplitude_scaled = 1.19}, Trip::amplitude_witness},
        Later{"a_decibel_and_a_half_less", {.amplitude_scaled = 0.84}, Trip::amplitude_witness},
        Later{"dead", {.dead_table = true}, Trip::amplitude_witness},
        Later{"rms", {.unit_rms = true}, Trip::amplitude_witness}),
    [](const auto& given) { return std::string(given.param.name); });

TEST(AmplitudeWitness, NineTenthsOfADecibelAreNoReasonToStop) {
    for (const double decibel : {-0.9, 0.9}) {
        WitnessedRig rig;
        rig.rig.shaker().lie({.amplitude_scaled = std::pow(10, decibel / 20)});
        rig.shake(5);
        rig.wait(20);
        EXPECT_EQ(rig.trip(), Trip::none) << decibel << " dB: " << rig.text();
    }
}

TEST(AmplitudeWitness, EachAccelerometerIsAWitnessOfItsOwn) {
    // GIVEN isolators that pass a third less than is configured, and a table that is right
    auto truth = quiet_truth();
    truth.transmission = 0.45;
    WitnessedRig rig(truth);
    rig.shake(5);
    rig.wait(2);
    EXPECT_EQ(rig.trip(), Trip::amplitude_witness);
    EXPECT_NE(rig.text().find("platform"), std::string::npos) << rig.text();
    // WHEN the loop check is just measuring that THEN it is let
    WitnessedRig checked(truth);
    checked.transmission_known = false;
    checked.shake(0.5);
    checked.wait(5);
    EXPECT_EQ(checked.trip(), Trip::none) << checked.text();
    // and what it has measured is in force
    WitnessedRig measured(truth);
    measured.interlock.transmission(0.45);
    measured.shake(5);
    measured.wait(5);
    EXPECT_EQ(measured.trip(), Trip::none) << measured.text();
}

TEST(AmplitudeWitness, WithoutATableAccelerometerThePlatformStillTells) {
    WitnessedRig rig;
    rig.sample.quality[static_cast<std::size_t>(Channel::table_accel)] = drivers::Quality::unbound;
    rig.shake(5);
    rig.wait(3);
    ASSERT_EQ(rig.trip(), Trip::none) << rig.text();
    rig.rig.shaker().lie({.amplitude_scaled = 1.5});
    EXPECT_LE(rig.until_trip(3), 0.5);
    EXPECT_EQ(rig.trip(), Trip::amplitude_witness);
}

/// Readings that are good in one of `of`, flagged else.
std::function<void(drivers::Sample&)> flagged_but_one_in(unsigned of, bool of_table) {
    return [of, of_table, n = 0U](drivers::Sample& sample) mutable {
        const auto quality = n++ % of == 0 ? drivers::Quality::good : drivers::Quality::flagged;
        for (std::size_t c = 3; c < 6; ++c) sample.quality[c] = quality;
        if (of_table) sample.quality[6] = quality;
    };
}

TEST(AmplitudeWitness, OneWhoseReadingsAreInvalidDoesNotKnowAndThatStops) {
    for (const unsigned of : {3U, 4U, 1000U}) {
        for (const bool table : {true, false}) {
            WitnessedRig rig;
            if (!table) rig.sample.quality[6] = drivers::Quality::unbound;
            rig.shake(5);
            rig.wait(3);
            ASSERT_EQ(rig.trip(), Trip::none) << rig.text();
            rig.spoil = flagged_but_one_in(of, table);
            const double taken = rig.until_trip(3);
            EXPECT_EQ(rig.trip(), Trip::amplitude_witness) << of << " " << rig.text();
            // half a window until they are too few, and a window and 150 ms of that
            EXPECT_GT(taken, 0.4);
            EXPECT_LE(taken, 0.8);
            EXPECT_NE(rig.text().find("platform does not know the amplitude"), std::string::npos)
                << rig.text();
        }
    }
}

TEST(AmplitudeWitness, WhatDisagreesWheneverItIsKnownStops) {
    for (const double scaled : {0.5, 1.9}) {
        // GIVEN six good readings in half a second: the amplitude is known for 100 ms of it
        WitnessedRig rig;
        rig.sample.quality[6] = drivers::Quality::unbound;
        rig.shake(5);
        rig.wait(3);
        rig.spoil = [n = 0U](drivers::Sample& sample) mutable {
            const bool good = n++ % 20 < 6;
            for (std::size_t c = 3; c < 6; ++c)
                sample.quality[c] = good ? drivers::Quality::good : drivers::Quality::flagged;
        };
        rig.wait(20);
        ASSERT_EQ(rig.trip(), Trip::none) << rig.text();
        rig.rig.shaker().lie({.amplitude_scaled = scaled});
        const double taken = rig.until_trip(3);
        EXPECT_GT(taken, 0) << scaled;
        EXPECT_LE(taken, 1.2) << scaled;
        EXPECT_EQ(rig.trip(), Trip::amplitude_witness) << scaled;
    }
}

/// A share of all frames is lost.
std::function<void(drivers::Sample&)> lossy(unsigned seed, double share) {
    return [random = std::mt19937(seed),
            lost = std::bernoulli_distribution(share)](drivers::Sample& sample) mutable {
        const auto quality = [&] {
            return lost(random) ? drivers::Quality::missing : drivers::Quality::good;
        };
        sample.quality[3] = sample.quality[4] = quality();
        sample.quality[5] = quality();
        sample.quality[6] = quality();
    };
}

TEST(AmplitudeWitness, ReadingsThatAreLostNowAndThenAreNoReasonToStop) {
    // A tenth of all frames: nearly two in ten samples lack one of the platform's.
    for (unsigned seed = 1; seed <= 3; ++seed) {
        WitnessedRig rig;
        rig.spoil = lossy(seed, 0.1);
        rig.shake(9);
        rig.wait(1200);
        EXPECT_EQ(rig.trip(), Trip::none) << "seed " << seed << ": " << rig.text();
    }
}

TEST(AmplitudeWitness, EachThatContradictsTheCommandAtTheTripIsNamed) {
    // GIVEN a node that shows the last values of all accelerometers for ever
    WitnessedRig rig;
    rig.shake(5);
    rig.wait(3);
    EXPECT_EQ(rig.interlock.contradicts(), (std::array<bool, 2>{false, false}));
    rig.frozen = true;
    EXPECT_LE(rig.until_trip(3), 0.6);
    EXPECT_EQ(rig.trip(), Trip::amplitude_witness) << rig.text();
    EXPECT_EQ(rig.interlock.contradicts(), (std::array<bool, 2>{true, true}));
    // one that is stuck alone is named alone, though another cause trips before it is for long
    for (const bool early : {false, true}) {
        WitnessedRig one;
        one.position({40, 10, 30});
        one.shake(7);
        one.wait(3);
        one.stuck = 3;
        for (int n = 0; n < 120 && one.trip() == Trip::none; ++n) {
            one.tick();
            if (early && one.interlock.contradicts()[1]) break;
        }
        EXPECT_EQ(one.trip(), early ? Trip::none : Trip::stuck) << one.text();
        if (early) one.interlock.trip(Trip::emergency_stop);
        EXPECT_EQ(one.interlock.contradicts(), (std::array<bool, 2>{false, true}));
        // WHEN nothing is excited by the next sample THEN that holds, until it is acknowledged
        one.interlock.guard(Guard::idle);
        one.tick();
        EXPECT_EQ(one.interlock.contradicts(), (std::array<bool, 2>{false, true}));
        one.interlock.acknowledge(one.interlock.latched());
        one.tick();
        EXPECT_EQ(one.interlock.contradicts(), (std::array<bool, 2>{false, false}));
    }
}

class Stuck : public testing::TestWithParam<std::size_t> {};

TEST_P(Stuck, IsSaidOfAnAccelerometerThatCeasesToMoveWithinASecond) {
    WitnessedRig rig;
    rig.position({40, 10, 30});  // every accelerometer has its share of the vertical
    rig.shake(7);
    rig.wait(3);
    ASSERT_EQ(rig.trip(), Trip::none) << rig.text();
    rig.stuck = GetParam();
    const double taken = rig.until_trip(3);
    EXPECT_EQ(rig.trip(), Trip::stuck) << rig.text();
    EXPECT_GT(taken, 0);
    EXPECT_LE(taken, 1);
    const std::array names{"accel_x", "accel_y", "accel_z", "table_accel"};
    EXPECT_NE(rig.text().find(names[GetParam()]), std::string::npos) << rig.text();
}

INSTANTIATE_TEST_SUITE_P(Every, Stuck, testing::Range<std::size_t>(0, 4));

TEST(AmplitudeWitness, AnAxisThatShouldBeStillIsNotStuck) {
    WitnessedRig rig;
    rig.shake(9);
    rig.stuck = 0;  // x lies level at 0, 0, 0
    rig.wait(10);
    EXPECT_EQ(rig.trip(), Trip::none) << rig.text();
}

TEST(AmplitudeWitness, WithoutMotionAtAllNothingIsSaid) {
    WitnessedRig rig;
    rig.interlock.guard(Guard::excitation);
    rig.interlock.command(0, rig.degrees());
    rig.wait(20);
    EXPECT_EQ(rig.trip(), Trip::none) << rig.text();
}

TEST(AmplitudeWitness, ARampThatTheControllerBeginsLateIsJudgedFromThenOn) {
    WitnessedRig rig;
    rig.shake(9, 2, 1.5);
    rig.wait(3);
    rig.rest(2, 1.5);
    EXPECT_EQ(rig.trip(), Trip::none) << rig.text();
}

TEST(AmplitudeWitness, ATableThatDoesNotComeDownStopsBeforeTheRampIsOver) {
    WitnessedRig rig;
    rig.shake(9);
    rig.wait(3);
    rig.rig.shaker().lie({.slow_ramp = 10});
    rig.ask(0, 2);
    const double taken = rig.until_trip(5);
    EXPECT_EQ(rig.trip(), Trip::amplitude_witness) << rig.text();
    EXPECT_LE(taken, 2.5);
}

/// One campaign of a rig that is as good as a rig has to be: nothing stops it.
void clean_campaign(unsigned seed, int positions) {
    std::mt19937 random(seed);
    const auto between = [&random](double low, double high) {
        return std::uniform_real_distribution(low, high)(random);
    };
    plant::Truth truth;
    truth.seed = seed;
    truth.damping = between(0.05, 0.3);
    truth.second_harmonic = between(0, 0.05);
    truth.slew_kick_g = between(0, 0.1);
    truth.accelerometer_g = between(0, 1e-3);
    for (auto& zero : truth.zero_g) zero = between(-0.03, 0.03);
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j)
            truth.matrix[i][j] = (i == j ? 1 : 0) + between(-0.005, 0.005);
    const double measured = truth.transmission * between(0.97, 1.03);
    WitnessedRig rig(truth, measured);
    rig.rig.shaker().lie({.amplitude_scaled = between(0.95, 1.05)});
    rig.spoil = lossy(seed, between(0, 0.05));
    for (int n = 0; n < positions && rig.trip() == Trip::none; ++n) {
        rig.interlock.guard(Guard::armed);
        rig.position({between(-180, 180), between(-30, 30), between(-180, 180)});
        const std::array levels{0.0, 0.1, 0.5, 3.0, 7.0, 9.0};
        const double level = levels[random() % levels.size()], ramp_s = between(0.5, 4);
        if (level == 0) {
            rig.interlock.guard(Guard::excitation);
            rig.interlock.command(0, rig.degrees());
            rig.wait(5);
            continue;
        }
        rig.shake(level, ramp_s, between(0, 0.4));
        rig.wait(8);
        rig.rest(ramp_s, between(0, 0.4));
        ASSERT_EQ(rig.trip(), Trip::none) << "seed " << seed << ", position " << n << ", " << level
                                          << " g in " << ramp_s << " s: " << rig.text();
    }
}

TEST(CleanCampaigns, AreNotStopped) {
    for (unsigned seed = 1; seed <= 20; ++seed) clean_campaign(seed, 6);
}

TEST(CleanCampaignsSoak, AreNotStopped) {
    for (unsigned seed = 1001; seed <= 1400; ++seed) clean_campaign(seed, 28);
}

/// A pure sine at another frequency and rate, with a phase of its own.
drivers::Sample sine(Time time, double hz, double phase, double table_g, double transmission) {
    drivers::Sample sample;
    sample.quality.fill(drivers::Quality::good);
    const double a =
        std::sin(2 * std::numbers::pi * std::fmod(hz * drivers::to_seconds(time), 1) + phase);
    sample.time = time;
    sample.table_accel = table_g * a;
    sample.force = {0, 0, 1 + table_g * transmission * a};
    return sample;
}

TEST(AmplitudeWitness, SeesTheAmplitudeAtAnyFrequencyAndRateThatAConfigurationMayHave) {
    struct Sampled {
        double hz, rate;
    };
    for (const Sampled& one : {Sampled{15, 40},
                               {13.333, 40},
                               {19.7, 40},
                               {20.3, 40},
                               {26.667, 40},
                               {39.5, 40},
                               {55, 40},
                               {5, 40},
                               {15, 100},
                               {49, 100},
                               {15, 1000},
                               {200, 1000},
                               {1, 10}}) {
        const auto period = drivers::from_seconds(1 / one.rate);
        AmplitudeWitness::Settings settings;
        settings.frequency_hz = one.hz;
        settings.sample_period = period;
        for (int turn = 0; turn < 8; ++turn) {
            AmplitudeWitness witness(settings);
            AmplitudeWitness::Verdict verdict;
            AmplitudeWitness::Situation now;
            now.transmission = 0.5;
            now.ramp.target_g = 6;
            now.controller_began = 1;
            now.limit_g = 12;
            now.steady = true;
            int shown = 0;
            for (Time t = kSecond; drivers::to_seconds(t) < 1 + 6 * witness.window_s();
                 t += period) {
                now.now = t;
                if (!witness.add(sine(t, one.hz, turn * 0.8, 6, 0.5))) continue;
                verdict = witness.verdict(now);
                EXPECT_FALSE(verdict.off_command.wrong) << one.hz << " Hz at " << one.rate;
                if (verdict.seen_g[0] < 0) continue;
                ++shown;
                EXPECT_NEAR(verdict.seen_g[0], 6, 0.01) << one.hz << " Hz at " << one.rate;
                EXPECT_NEAR(verdict.seen_g[1], 6, 0.01) << one.hz << " Hz at " << one.rate;
            }
            EXPECT_GT(shown, 0) << one.hz << " Hz at " << one.rate;
        }
    }
}

TEST(AmplitudeWitness, HasNoRateThatNobodyStated) {
    EXPECT_THROW(AmplitudeWitness(AmplitudeWitness::Settings{}), std::invalid_argument);
}

/// A sweep at 6 g, 0.5 of it at the platform and 1 of it beyond 60 Hz; `scaled`: what the table
/// does from 10 s on. When it was found wrong, s, negative: never; and for how long nothing was
/// shown.
struct Swept {
    double wrong_s = -1, blind_s = 0, farthest_g = 0;
};
Swept swept(double from_hz, double to_hz, double rate_hz, double scaled) {
    constexpr double kLasts_s = 40, kBegins_s = 2;
    const auto period = drivers::from_seconds(1 / rate_hz);
    AmplitudeWitness::Settings settings;
    settings.sample_period = period;
    AmplitudeWitness witness(settings);
    AmplitudeWitness::Situation now;
    now.ramp.start_g = now.ramp.target_g = 6;
    now.controller_began = 1;
    now.limit_g = 12;
    now.steady = true;
    Sweep sweep{from_hz, to_hz, 0, kSecond, {}};
    for (std::size_t i = 0; i < Sweep::kAlong; ++i)
        sweep.transmission[i] = 0.5 + 0.5 * static_cast<double>(i) / (Sweep::kAlong - 1);
    Swept out;
    double phase = 0, shown = 0, all = 0;
    for (Time t = kSecond; drivers::to_seconds(t - kSecond) < kBegins_s + kLasts_s; t += period) {
        const double since = drivers::to_seconds(t - kSecond);
        if (since >= kBegins_s && sweep.octaves_per_s == 0) {
            sweep.begin = kSecond + drivers::from_seconds(kBegins_s);
            sweep.octaves_per_s = std::abs(std::log2(to_hz / from_hz)) / kLasts_s;
            witness.follow(sweep);
        } else if (t == kSecond) {
            witness.follow(sweep);
        }
        phase += 2 * std::numbers::pi * sweep.hz(t) / rate_hz;
        const double g = (since > 10 ? scaled : 1) * 6 * std::sin(phase);
        drivers::Sample sample;
        sample.time = now.now = t;
        sample.quality.fill(drivers::Quality::good);
        now.transmission = sweep.transmission_at(t);
        sample.force = {0, 1 + now.transmission * g, 0};
        sample.table_accel = g;
        if (!witness.add(sample)) continue;
        const auto verdict = witness.verdict(now);
        all += 1;
        shown += verdict.seen_g[0] >= 0 ? 1 : 0;
        if (verdict.seen_g[0] >= 0 && since > 1)
            out.farthest_g = std::max(out.farthest_g, std::abs(verdict.seen_g[0] - 6));
        if (verdict.off_command.wrong && out.wrong_s < 0) out.wrong_s = since;
    }
    out.blind_s = (1 - shown / all) * (kBegins_s + kLasts_s);
    return out;
}

TEST(AmplitudeWitness, FollowsASweepUpAndDown) {
    for (const double rate_hz : {100.0, 400.0, 2000.0}) {
        for (const auto& [from, to] : {std::pair{20.0, 120.0}, std::pair{120.0, 20.0}}) {
            const Swept honest = swept(from, to, rate_hz, 1);
            EXPECT_LT(honest.wrong_s, 0) << rate_hz << " " << from;
            EXPECT_LT(honest.farthest_g, 0.15) << rate_hz << " " << from;
            // About multiples of half the rate, of which there are two at 100/s, amplitude and
            // phase are one: 3.4 Hz each, and as much as the window is long.
            EXPECT_LT(honest.blind_s, rate_hz > 250 ? 1.5 : 7) << rate_hz << " " << from;
        }
    }
}

TEST(AmplitudeWitness, WhatDisagreesInASweepStopsWithinHalfASecond) {
    for (const double scaled : {0.0, 0.7, 1.5}) {
        const Swept lie = swept(20, 120, 400, scaled);
        EXPECT_GT(lie.wrong_s, 10) << scaled;
        EXPECT_LT(lie.wrong_s, 10.6) << scaled;
    }
}

}  // namespace
}  // namespace vibrig::rt
