#include "daemon/guard/witnesses.hpp"
#include "tests/unit/support/temporary_folder.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <numbers>
#include <string>
#include <string_view>

namespace vibrig::guard {
namespace {

constexpr drivers::Time kPeriod = 25 * drivers::kMillisecond;

/// Of samples that come so.
WitnessSettings stated() {
    WitnessSettings settings;
    settings.sample_rate_hz = 1 / drivers::to_seconds(kPeriod);
    return settings;
}

/// Frames as the rig sends them, by the codec.
class Bus {
  public:
    explicit Bus(Witnesses& witnesses, std::string_view dbc = proto::rig_dbc_text())
        : witnesses_(witnesses), dbc_(proto::parse_dbc(dbc, "rig.dbc")) {}

    void send(const char* message, std::initializer_list<std::pair<const char*, double>> values,
              drivers::Time time) {
        const auto* found = dbc_.find(message);
        drivers::ReceivedFrame received;
        received.time = time;
        received.frame.can_id = found->id;
        received.frame.len = found->size;
        for (const auto& [name, value] : values)
            for (const auto& signal : found->signals)
                if (signal.name == name) {
                    ASSERT_TRUE(proto::encode(signal, value, {received.frame.data, found->size}));
                }
        witnesses_.take(std::span(&received, 1));
    }
    /// One sample: table and platform, along y.
    void sample(double table_g, double platform_g, drivers::Time time, bool valid = true) {
        send("AccelerometersXY",
             {{"X", 0}, {"Y", 1 + platform_g}, {"XValid", 1}, {"YValid", valid ? 1 : 0}}, time);
        send("AccelerometerZ", {{"Z", 0}, {"ZValid", 1}}, time);
        send("TableAccelerometer", {{"Axial", table_g}}, time);
    }
    void shake(double table_g, double platform_g, int samples) {
        for (int i = 0; i < samples; ++i) {
            now += kPeriod;
            const double wave = std::sin(2 * std::numbers::pi * 15 * drivers::to_seconds(now));
            sample(table_g * wave, platform_g * wave, now);
        }
    }
    drivers::Time now = drivers::kSecond;

  private:
    Witnesses& witnesses_;
    proto::Dbc dbc_;
};

TEST(Witnesses, HaveNoRateThatNobodyStated) {
    EXPECT_THROW(Witnesses{WitnessSettings{}}, SettingsError);
}

TEST(Witnesses, SeeThePlatformThroughItsTransmissionAndTheTableAsItIs) {
    Witnesses witnesses{stated()};
    Bus bus(witnesses);
    bus.shake(6, 4, 80);
    const auto sight = witnesses.sight(bus.now);
    ASSERT_TRUE(sight.table.known && sight.platform.known);
    EXPECT_NEAR(sight.table.peak_g, 6, 0.3);
    EXPECT_NEAR(sight.platform.peak_g, 4, 0.2);
    EXPECT_NEAR(sight.table_g, 6, 0.3);
    EXPECT_TRUE(sight.moves(safety::kMoving_g));
    EXPECT_FALSE(sight.rests(safety::kRest_g));
}

/// Accelerometers that see 0.8 of an amplitude: of 6 g at the table and 4 at the platform 3.2.
TEST(Witnesses, SeeThePlatformThroughItsAccelerometers) {
    WitnessSettings settings = stated();
    settings.seen = 0.8;
    Witnesses witnesses{settings};
    Bus bus(witnesses);
    bus.shake(0.001, 3.2, 80);
    EXPECT_NEAR(witnesses.sight(bus.now).table_g, 6, 0.3);
}

TEST(Witnesses, RestOnlyWhenAllOfThemDo) {
    Witnesses witnesses{stated()};
    Bus bus(witnesses);
    bus.shake(0, 0, 80);
    EXPECT_TRUE(witnesses.sight(bus.now).rests(safety::kRest_g));
    bus.shake(0, 1, 80);  // the table's is dead, the platform moves
    EXPECT_FALSE(witnesses.sight(bus.now).rests(safety::kRest_g));
    EXPECT_TRUE(witnesses.sight(bus.now).moves(safety::kMoving_g));
    bus.shake(1, 0, 80);
    EXPECT_FALSE(witnesses.sight(bus.now).rests(safety::kRest_g));
    EXPECT_TRUE(witnesses.sight(bus.now).moves(safety::kMoving_g));
}

/// What it shows of a table that shakes at 5 g, with the accelerometers' noise.
struct Shown {
    bool table_stuck = false, platform_stuck = false;
    double noise_g = 1e-4;
};

/// As the guard does, a look every 50 ms.
Sight watched(Witnesses& witnesses, Bus& bus, double table_g, double shaker_g, double seconds,
              const Shown& shown) {
    for (int i = 0; i < seconds * 40; ++i) {
        bus.now += kPeriod;
        const double wave =
            table_g * std::sin(2 * std::numbers::pi * 15 * drivers::to_seconds(bus.now));
        const double noise = shown.noise_g * (i % 3 - 1);
        bus.sample(shown.table_stuck ? 0 : wave + noise,
                   shown.platform_stuck ? 0 : 0.6667 * wave + noise, bus.now);
        if (i % 2 == 0) witnesses.doubt(bus.now, shaker_g);
    }
    return witnesses.sight(bus.now);
}

TEST(Witnesses, ThatAreStuckWhileTheShakerSaysThatItShakesAreNotAtRest) {
    WitnessSettings settings = stated();
    settings.table.clear();
    Witnesses witnesses(settings);
    Bus bus(witnesses);
    // GIVEN the only witness, stuck while the controller does 5 g
    const Shown stuck{.platform_stuck = true};
    EXPECT_TRUE(watched(witnesses, bus, 0, 0, 2, stuck).rests(safety::kRest_g)) << "nobody shakes";
    const auto sight = watched(witnesses, bus, 5, 5, 1.2, stuck);
    EXPECT_TRUE(sight.platform_stuck);
    EXPECT_FALSE(sight.rests(safety::kRest_g));
    EXPECT_FALSE(sight.known()) << "nothing is armed with a guard that sees nothing";
    // WHEN the controller says that it stopped THEN that is not believed
    EXPECT_FALSE(watched(witnesses, bus, 5, 0, 10, stuck).rests(safety::kRest_g));
    // but by its noise it is seen to live
    EXPECT_TRUE(watched(witnesses, bus, 0, 0, 1, {}).rests(safety::kRest_g));
}

TEST(Witnesses, OfTwoTheOneThatIsNotStuckDecides) {
    for (const bool table : {true, false}) {
        Witnesses witnesses{stated()};
        Bus bus(witnesses);
        const Shown stuck{.table_stuck = table, .platform_stuck = !table};
        // No word of the controller is needed: the other one moves.
        const auto shaken = watched(witnesses, bus, 5, 0, 3, stuck);
        EXPECT_EQ(shaken.table_stuck, table);
        EXPECT_EQ(shaken.platform_stuck, !table);
        EXPECT_TRUE(shaken.known());
        EXPECT_FALSE(shaken.rests(safety::kRest_g));
        EXPECT_NEAR(shaken.table_g, 5, 0.4);
        EXPECT_TRUE(watched(witnesses, bus, 0, 0, 2, stuck).rests(safety::kRest_g));
    }
}

TEST(Witnesses, WhatIsStillBecauseNothingShakesIsNotStuck) {
    Witnesses witnesses{stated()};
    Bus bus(witnesses);
    // GIVEN readings without any noise, at rest, shaken, at rest
    for (const double g : {0.0, 5.0, 0.0}) {
        const auto sight = watched(witnesses, bus, g, g, 5, {.noise_g = 0});
        EXPECT_FALSE(sight.table_stuck || sight.platform_stuck) << g;
        EXPECT_EQ(sight.rests(safety::kRest_g), g == 0);
    }
}

TEST(Witnesses, OneWhoseNoiseIsGoneIsNotKnownAndNeverAtRest) {
    for (const bool both : {true, false}) {
        SCOPED_TRACE(both);
        Witnesses witnesses{stated()};
        Bus bus(witnesses);
        // GIVEN both, with their noise at rest, and shaken
        ASSERT_TRUE(watched(witnesses, bus, 0, 0, 10, {}).rests(safety::kRest_g));
        ASSERT_TRUE(watched(witnesses, bus, 5, 5, 3, {}).moves(safety::kMoving_g));
        // WHEN they show the same for ever, the controller at rest by its word
        for (int look = 0; look < 40; ++look) {
            const auto sight =
                watched(witnesses, bus, 5, 0, 0.05, {.table_stuck = both, .platform_stuck = true});
            EXPECT_FALSE(sight.rests(safety::kRest_g)) << look;
            EXPECT_EQ(sight.platform_frozen, look > 7) << look;
        }
        const auto sight = witnesses.sight(bus.now);
        EXPECT_EQ(sight.known(), !both);
        EXPECT_EQ(sight.table_frozen, both);
        // AND they are believed again with their noise
        EXPECT_TRUE(watched(witnesses, bus, 0, 0, 1, {}).rests(safety::kRest_g));
    }
}

TEST(Witnesses, OneThatNeverHadNoiseCannotBeFrozen) {
    WitnessSettings settings = stated();
    settings.table.clear();
    Witnesses witnesses(settings);
    Bus bus(witnesses);
    const Shown silent{.noise_g = 0};
    // GIVEN one that is shaken, rings down and slews, and in between shows the same
    for (int round = 0; round < 20; ++round) {
        watched(witnesses, bus, 3, 3, 2, silent);
        for (double g = 0.02; g > 1e-5; g *= 0.7) watched(witnesses, bus, g, 0, 0.2, silent);
        for (int i = 0; i < 200; ++i) bus.sample(0, -1e-3 * i, bus.now += kPeriod);
        // THEN its stillness is rest, as before
        const auto sight = watched(witnesses, bus, 0, 0, 5, silent);
        EXPECT_TRUE(sight.rests(safety::kRest_g)) << round;
        EXPECT_FALSE(sight.platform_frozen) << round;
    }
}

TEST(Witnesses, OneThatIsSilentIsNotCalledStuck) {
    Witnesses witnesses{stated()};
    Bus bus(witnesses);
    watched(witnesses, bus, 5, 5, 2, {});
    for (int i = 0; i < 60; ++i) witnesses.doubt(bus.now += kPeriod, 5);
    const auto sight = witnesses.sight(bus.now);
    EXPECT_FALSE(sight.table_stuck || sight.platform_stuck);
    EXPECT_FALSE(sight.rests(safety::kRest_g)) << "what is not seen is not at rest";
}

/// A frame of so many samples, and its DBC.
class Frames {
  public:
    explicit Frames(int parts) {
        std::string axes;
        int bit = 0;
        for (const char* axis : {"X", "Y", "Z", "Axial"})
            for (int part = 0; part < parts; ++part, bit += 16)
                axes += std::string(" SG_ ") + axis +
                        (part == 0 ? "" : "_" + std::to_string(part)) + " : " +
                        std::to_string(bit) + "|16@1- (0.001,0) [-31|31] \"g\" A\n";
        std::ofstream(path) << "VERSION \"\"\nBU_: A\nBO_ 273 Acc: 64 A\n" << axes;
        settings.dbc = path;
        settings.sample_rate_hz = 1000;
        settings.samples_per_frame = parts;
        settings.platform = {"Acc.X", "Acc.Y", "Acc.Z"};
        settings.platform_valid = {};
        settings.table = "Acc.Axial";
    }
    TemporaryFolder folder;
    std::string path = folder.file("several_samples.dbc");
    WitnessSettings settings;
};

TEST(Witnesses, SeeAllSamplesThatAFrameCarries) {
    constexpr int kParts = 8;
    Frames frames(kParts);
    Witnesses witnesses(frames.settings);
    // GIVEN 5 g at 125 Hz: the first samples of all frames are the same
    for (int frame = 0; frame < 200; ++frame) {
        drivers::ReceivedFrame received;
        received.frame.can_id = 273;
        received.frame.len = 64;
        const int last = frame * kParts + kParts - 1;
        // Frames come in bunches of four on a busy machine.
        received.time = (last / (4 * kParts) + 1) * 4 * kParts * drivers::kMillisecond;
        for (int part = 0; part < kParts; ++part) {
            const double wave =
                std::sin(2 * std::numbers::pi * 0.125 * (frame * kParts + part) + 0.4);
            const std::array<double, 4> values{0, 1 + 3 * wave, 0, 5 * wave};
            for (int axis = 0; axis < 4; ++axis) {
                const auto raw = static_cast<std::int16_t>(
                    std::lround(values[static_cast<std::size_t>(axis)] / 0.001));
                std::memcpy(received.frame.data + 2 * (axis * kParts + part), &raw, 2);
            }
        }
        witnesses.take(std::span(&received, 1));
    }
    const auto sight = witnesses.sight(1600 * drivers::kMillisecond);
    ASSERT_TRUE(sight.table.known && sight.platform.known);
    EXPECT_NEAR(sight.table.peak_g, 5, 0.05);
    EXPECT_NEAR(sight.platform.peak_g, 3, 0.05);
    EXPECT_FALSE(sight.rests(safety::kRest_g));
    EXPECT_TRUE(sight.moves(safety::kMoving_g));
}

TEST(Witnesses, OfAFrameThatCarriesFewerSamplesEachIsNamed) {
    Frames frames(2);
    frames.settings.samples_per_frame = 3;
    try {
        const Witnesses witnesses(frames.settings);
        ADD_FAILURE() << "a sample that is not there is taken";
    } catch (const SettingsError& error) {
        EXPECT_NE(std::string(error.what()).find("can.signals.table_accel: found \"Acc.Axial_2\""),
                  std::string::npos)
            << error.what();
    }
}

TEST(Witnesses, AnAxisThatSaysInvalidIsNotBelieved) {
    Witnesses witnesses{stated()};
    Bus bus(witnesses);
    for (int i = 0; i < 80; ++i) bus.sample(0, 0, bus.now += kPeriod, false);
    const auto sight = witnesses.sight(bus.now);
    EXPECT_FALSE(sight.platform.known);
    EXPECT_TRUE(sight.table.known);
    EXPECT_FALSE(sight.rests(safety::kRest_g)) << "a witness that is not known does not rest";
}

TEST(Witnesses, AValidityThatIsOutOfItsRangeIsNotBelieved) {
    // GIVEN a validity of two bits, of which 2 is an error and 3 not available
    std::string text(proto::rig_dbc_text());
    const std::string_view one_bit = "YValid : 49|1@1+";
    text.replace(text.find(one_bit), one_bit.size(), "YValid : 50|2@1+");
    const TemporaryFolder folder;
    WitnessSettings settings = stated();
    settings.dbc = folder.file("two_bits.dbc");
    std::ofstream(settings.dbc) << text;
    for (const int validity : {0, 1, 2, 3}) {
        Witnesses witnesses(settings);
        Bus bus(witnesses, text);
        for (int i = 0; i < 80; ++i) {
            bus.now += kPeriod;
            bus.send("AccelerometersXY", {{"X", 0}, {"Y", 1}, {"XValid", 1}, {"YValid", validity}},
                     bus.now);
            bus.send("AccelerometerZ", {{"Z", 0}, {"ZValid", 1}}, bus.now);
        }
        EXPECT_EQ(witnesses.sight(bus.now).platform.known, validity == 1) << validity;
    }
}

TEST(Witnesses, WhatIsOutOfItsRangeIsNotSeen) {
    constexpr double kBeyond_g = 31.9;  // of a DBC that says 31 g
    Witnesses witnesses{stated()};
    Bus bus(witnesses);
    // GIVEN readings that stand at a code for an error
    for (int i = 0; i < 80; ++i) bus.sample(kBeyond_g, kBeyond_g - 1, bus.now += kPeriod);
    auto sight = witnesses.sight(bus.now);
    EXPECT_FALSE(sight.table.known);
    EXPECT_FALSE(sight.platform.known);
    EXPECT_FALSE(sight.rests(safety::kRest_g));
    // WHEN it comes now and then THEN the others tell what moves
    for (int i = 0; i < 80; ++i) {
        bus.now += kPeriod;
        const double wave = std::sin(2 * std::numbers::pi * 15 * drivers::to_seconds(bus.now));
        bus.sample(i % 10 == 0 ? kBeyond_g : 5 * wave, 3 * wave, bus.now);
    }
    sight = witnesses.sight(bus.now);
    ASSERT_TRUE(sight.table.known && sight.platform.known);
    EXPECT_NEAR(sight.table.peak_g, 5, 0.5);
    EXPECT_NEAR(sight.platform.peak_g, 3, 0.3);
}

TEST(Witnesses, ASilentBusIsNeitherRestNorMotion) {
    Witnesses witnesses{stated()};
    Bus bus(witnesses);
    bus.shake(5, 3, 80);
    const auto sight = witnesses.sight(bus.now + drivers::kSecond);
    EXPECT_FALSE(sight.known());
    EXPECT_FALSE(sight.moves(safety::kMoving_g));
    EXPECT_FALSE(sight.rests(safety::kRest_g));
}

TEST(Witnesses, WithoutATableAccelerometerThePlatformIsTheWitness) {
    WitnessSettings settings = stated();
    settings.table.clear();
    Witnesses witnesses(settings);
    Bus bus(witnesses);
    bus.shake(0, 0, 80);
    EXPECT_TRUE(witnesses.sight(bus.now).rests(safety::kRest_g));
    bus.shake(0, 4, 80);
    EXPECT_NEAR(witnesses.sight(bus.now).table_g, 6, 0.3);
}

TEST(Witnesses, WithoutAnyTheGuardRefusesToStart) {
    WitnessSettings settings = stated();
    settings.table.clear();
    settings.platform = {};
    EXPECT_THROW(Witnesses{settings}, SettingsError);
    settings.table = "TableAccelerometer.Axal";
    try {
        Witnesses witnesses(settings);
        ADD_FAILURE() << "a signal that does not exist is taken";
    } catch (const SettingsError& error) {
        EXPECT_NE(std::string(error.what())
                      .find("can.signals.table_accel: found \"TableAccelerometer.Axal\", expected"),
                  std::string::npos)
            << error.what();
    }
}

/// What the guard says of a file that is well written.
std::string refusal_of(const std::string& text) {
    const auto settings = parse_settings("guard.socket = \"@g\"\n" + text, "rig.toml");
    try {
        const Witnesses witnesses(settings.witness);
    } catch (const SettingsError& error) {
        return error.what();
    }
    return "taken";
}

TEST(Witnesses, WhatTheDbcDoesNotHaveIsReportedWithThePlaceOfItsKey) {
    const std::string simulated = "commission.simulated = true\n";
    EXPECT_EQ(refusal_of(simulated + R"([can.signals]
accel_x = "AccelerometersXY.Q"
accel_y_valid = "AccelerometersXY"
accel_z = ""
table_accel = "Nobody.Axial"
)"),
              "rig.toml:4:11: can.signals.accel_x: found \"AccelerometersXY.Q\", expected a signal "
              "of the DBC, as \"Message.Signal\"\n"
              "rig.toml:5:17: can.signals.accel_y_valid: found \"AccelerometersXY\", expected a "
              "signal of the DBC, as \"Message.Signal\"\n"
              "rig.toml:7:15: can.signals.table_accel: found \"Nobody.Axial\", expected a signal "
              "of the DBC, as \"Message.Signal\"\n");
    EXPECT_EQ(refusal_of(simulated + "can.signals = { accel_x = \"\", table_accel = \"\" }\n"),
              "rig.toml:3:45: can.signals.table_accel: found \"\" and not three accelerometers on "
              "the platform, expected one of both at least: the guard would see nothing\n");
}

TEST(Witnesses, ADbcThatDoesNotFitIsReportedWithThePlaceOfItsKey) {
    const std::string simulated = "commission.simulated = true\n";
    EXPECT_EQ(
        refusal_of(simulated + "[can]\ndbc = \"/nowhere/bus.dbc\"\n"),
        "rig.toml:4:7: can.dbc: found \"/nowhere/bus.dbc\" (cannot be opened: No such file or "
        "directory), expected a DBC file that can be read\n");
    // GIVEN one of another rig, and [can.signals] left out
    const TemporaryFolder folder;
    const std::string path = folder.file("another_rig.dbc");
    std::ofstream(path)
        << "VERSION \"\"\nBU_: A\nBO_ 1 M: 8 A\n SG_ S : 0|8@1+ (1,0) [0|0] \"\" A\n";
    const auto said = refusal_of("clock.source = \"rig\"\n[can]\ndbc = \"" + path + "\"\n");
    for (const char* part :
         {"rig.toml:4:7: can.signals.accel_x: found \"AccelerometersXY.X\" (default), expected a "
          "signal of the DBC",
          "rig.toml:4:7: can.signals.table_accel: found \"TableAccelerometer.Axial\" (default), ",
          "rig.toml:2:16: clock.source: found \"rig\" and no RigTime.TimeUs in the DBC, expected "
          "the simulated rig's message\n"})
        EXPECT_NE(said.find(part), std::string::npos) << part << "\n" << said;
}

TEST(Witnesses, GoByTheRigsTimeWhereItOwnsTheTime) {
    WitnessSettings settings = stated();
    settings.rig_time = true;
    Witnesses witnesses(settings);
    Bus bus(witnesses);
    // GIVEN 80 samples that come within 80 us, at 100 000 times real time
    for (int i = 0; i < 80; ++i) {
        bus.send("RigTime", {{"TimeUs", 25e3 * i}, {"TickEnd", 0}}, 1000 * i);
        bus.sample(0, 0, 1000 * i);
    }
    EXPECT_TRUE(witnesses.sight(80'000).rests(safety::kRest_g));
    EXPECT_EQ(witnesses.time(80'000), 79 * kPeriod);
    // THEN a rig that is slow is seen
    EXPECT_TRUE(witnesses.sight(drivers::kSecond / 2).rests(safety::kRest_g));
    // but one that has fallen silent on the wall is not, though no time passes there
    EXPECT_FALSE(witnesses.sight(2 * drivers::kSecond).known());
}

}  // namespace
}  // namespace vibrig::guard
