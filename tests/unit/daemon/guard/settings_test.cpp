#include "daemon/guard/settings.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <sstream>

#include "daemon/configuration/configuration.hpp"
#include "daemon/configuration/schema.hpp"
#include "daemon/guard/known_keys.hpp"

namespace vibrig::guard {
namespace {

const std::string kGuard = "guard.socket = \"/run/guard.sock\"\ncommission.simulated = true\n";

std::string refusal(const std::string& text) {
    try {
        (void)parse_settings(text, "rig.toml");
    } catch (const SettingsError& error) {
        return error.what();
    }
    return "taken";
}

/// "key = value" of what one of the two programs prints with --check.
std::map<std::string, std::string> values_of(const std::string& printed) {
    std::map<std::string, std::string> values;
    std::istringstream lines(printed);
    for (std::string line; std::getline(lines, line);) {
        const auto equals =
            line.find(" = ") == std::string::npos ? line.find(" =  ") : line.find(" = ");
        if (line.front() == '#' || equals == std::string::npos) continue;
        auto trim = [](std::string text) {
            text.erase(0, text.find_first_not_of(' '));
            text.erase(text.find_last_not_of(' ') + 1);
            return text;
        };
        const auto comment = line.find("  #");
        values[trim(line.substr(0, equals))] = trim(
            line.substr(equals + 3, comment == std::string::npos ? comment : comment - equals - 3));
    }
    return values;
}

void expect_agreement(const std::string& text) {
    const auto guard = values_of(parse_settings(text, "rig.toml").believed);
    const auto daemon =
        values_of(configuration::format_effective(configuration::parse(text, "rig.toml", true)));
    std::size_t compared = 0;
    for (const auto& [key, value] : guard) {
        const auto found = daemon.find(key);
        if (found == daemon.end()) continue;
        ++compared;
        // Numbers may be written in two ways.
        char* end = nullptr;
        const double number = std::strtod(value.c_str(), &end);
        if (*end == '\0') {
            EXPECT_EQ(number, std::strtod(found->second.c_str(), nullptr)) << key;
        } else {
            EXPECT_EQ(value, found->second) << key;
        }
    }
    EXPECT_GE(compared + 1, guard.size()) << "all but one at most";
    EXPECT_GT(compared, 40u);
}

TEST(GuardSettings, AreTheDaemonsOwnWhereNothingIsSaid) { expect_agreement(kGuard); }

TEST(GuardSettings, AreTheDaemonsOwnWhereMuchIsSaid) {
    expect_agreement(kGuard + R"([site]
gravity_mps2 = 9.81
[vibration]
transmission = 0.5
[accelerometer]
zero_g = [0.01, 0, -0.5]
bandwidth_hz = 200.0
order = 2
[can]
port = "seqpacket"
path = "@bus"
fd = false
receive_buffer = 8192
sample_rate_hz = 100
samples_per_frame = 4
[can.signals]
accel_x = "AccelerometersXY.Y"
accel_x_valid = ""
table_accel = ""
[campaign]
table_g = [2.0]
[shaker]
host = "127.0.0.40"
port = 1502
unit = 7
amplitude_unit = "g_rms"
limits = { acceleration_g = 8.5 }
[shaker.registers]
run = { address = 30, type = "bits", mask = 4 }
measured_amplitude = { address = 40, type = "f32", word_order = "little", scale = 0.5 }
[annunciator]
modbus = { host = "horn", port = 1503, unit = 9, horn_coil = 2, lamp_coil = 3 }
command = "/usr/local/bin/page-me"
command_limit_s = 20
)");
}

TEST(GuardSettings, AreTheDaemonsOwnOfAHardMount) {
    const auto hard = kGuard + "[spectrum]\nmount = \"hard\"\n";
    expect_agreement(hard);
    EXPECT_EQ(parse_settings(hard, "rig.toml").witness.transmission, 1);
}

/// |A| at the reference frequency: Butterworth, or straight on logarithmic scales between two rows.
TEST(GuardSettings, KnowWhatTheAccelerometersSee) {
    const auto seen = [](const std::string& text) {
        return parse_settings(std::string(kGuard) + text, "rig.toml").witness.seen;
    };
    EXPECT_EQ(seen(""), 1);
    EXPECT_NEAR(seen("[accelerometer]\nbandwidth_hz = 100\n"), 1 / std::sqrt(1.0225), 1e-12);
    EXPECT_NEAR(seen("[accelerometer]\nbandwidth_hz = 100\norder = 2\n[vibration]\n"
                     "frequency_hz = 100\n"),
                std::sqrt(0.5), 1e-12);
    const std::string table = "[accelerometer]\nresponse = [[20, 1], [80, 0.64]]\n";
    EXPECT_EQ(seen(table), 1);
    EXPECT_NEAR(seen(table + "[vibration]\nfrequency_hz = 40\n"), 0.8, 1e-12);
    EXPECT_NE(refusal(std::string(kGuard) + "[accelerometer]\nresponse = [[80, 1], [20, 1]]\n")
                  .find("accelerometer.response: found"),
              std::string::npos);
}

TEST(GuardSettings, KnowHowMuchMoreThePlatformCanShow) {
    const auto most = [](const std::string& text) {
        return parse_settings(std::string(kGuard) + text, "rig.toml").judge.most_ratio;
    };
    // Pads with a damping of 0.2 let 2.733 through at their peak, 0.6667 at the reference.
    EXPECT_NEAR(most(""), 2.733 / 0.6667, 0.01);
    EXPECT_NEAR(most("[spectrum]\npads_damping = 0.05\n"), 10.06 / 0.6667, 0.05);
    EXPECT_NEAR(most("[spectrum]\ntransmission = [[10, 1.4], [60, 0.05]]\n"), 1.4 / 0.6667, 0.01);
    EXPECT_NEAR(most("[spectrum]\nmount = \"hard\"\n"), 1, 0.01);
    EXPECT_NEAR(most("[spectrum]\nmount = \"hard\"\n[accelerometer]\nbandwidth_hz = 15\n"),
                std::sqrt(2), 0.01);
    EXPECT_NE(refusal(kGuard + "[spectrum]\ntransmission = \"pad\"\n")
                  .find("spectrum.transmission: found \"pad\" (a string), expected \"pads\" or "
                        "pairs"),
              std::string::npos);
}

TEST(GuardSettings, FoldTheAmplitudesUnitIn) {
    const auto settings =
        parse_settings(kGuard +
                           "[shaker]\namplitude_unit = \"g_rms\"\n[shaker.registers]\n"
                           "measured_amplitude = { scale = 0.01 }\n",
                       "rig.toml");
    EXPECT_DOUBLE_EQ(settings.shaker.measured_amplitude.scale, 0.01 * std::sqrt(2.0));
}

TEST(GuardSettings, WithoutASocketThereIsNothingToMeetAt) {
    EXPECT_EQ(refusal("commission.simulated = true"),
              "rig.toml: guard.socket: found \"\" (default), expected an absolute path or "
              "\"@name\": vibrigd and the guard meet there\n");
    EXPECT_NE(refusal("[guard]\nsocket = \"guard.sock\"\n").find("rig.toml:2:10: guard.socket"),
              std::string::npos);
}

TEST(GuardSettings, NeverWritesItsOwnMapToAForeignController) {
    const std::string real = "guard.socket = \"/run/guard.sock\"\n";
    const auto said = refusal(real);
    EXPECT_NE(
        said.find("shaker.registers.run.address: found nothing (default), expected it stated"),
        std::string::npos)
        << said;
    const std::string half = "[shaker.registers]\nrun = { address = 30, type = \"u16\" }\n";
    EXPECT_NE(refusal(real + half).find("measured_amplitude.address"), std::string::npos);
    const std::string unscaled = half + "measured_amplitude = { address = 40, type = \"f32\" }\n";
    EXPECT_NE(refusal(real + unscaled).find("measured_amplitude.scale"), std::string::npos);
    const std::string more =
        half + "measured_amplitude = { address = 40, type = \"u16\", scale = 1e-4 }\n";
    EXPECT_NE(refusal(real + more).find("ramp_time.address"), std::string::npos);
    const std::string ramp = more + "ramp_time = { address = 31, type = \"u16\"";
    EXPECT_NE(refusal(real + ramp + " }\n").find("ramp_time.scale"), std::string::npos);
    EXPECT_EQ(refusal(real + ramp + ", scale = 0.001 }\n"), "taken");
}

TEST(GuardSettings, TakesEachRateThatVibrigdTakes) {
    EXPECT_EQ(refusal(kGuard + "[can]\nsample_rate_hz = 10000\n"), "taken");
    EXPECT_NE(refusal(kGuard + "[can]\nsample_rate_hz = 10001\n").find("can.sample_rate_hz"),
              std::string::npos);
}

TEST(GuardSettings, ASerialLineIsRefusedWithTheReason) {
    const auto said = refusal(kGuard + "[shaker]\ntransport = \"rtu\"\ndevice = \"/dev/ttyS0\"\n");
    EXPECT_NE(
        said.find("rig.toml:4:13: shaker.transport: found \"rtu\", expected \"tcp\": a serial "
                  "line has one master"),
        std::string::npos)
        << said;
}

TEST(GuardSettings, EachBadValueIsReportedWithPlaceFoundAndExpected) {
    const auto said = refusal(kGuard + R"([can]
port = "ethernet"
sample_rate_hz = nan
[shaker]
port = 70000
host = 5
[shaker.registers.run]
table = "input"
[accelerometer]
zero_g = [1, 2]
[annunciator]
command = "page-me"
modbus = { horn_coil = 1, lamp_coil = 1 }
)");
    for (const char* part :
         {"rig.toml:4:8: can.port: found \"ethernet\" (a string), expected \"socketcan\" or "
          "\"seqpacket\"",
          "rig.toml:5:18: can.sample_rate_hz: found nan, expected a number from 1 to 10000",
          "rig.toml:7:8: shaker.port: found 70000, expected a whole number from 1 to 65535",
          "rig.toml:8:8: shaker.host: found 5, expected a string",
          "rig.toml:10:9: shaker.registers.run.table: found \"input\", expected \"holding\"",
          "rig.toml:12:10: accelerometer.zero_g: found an array, expected 3 finite numbers",
          "rig.toml:14:11: annunciator.command: found \"page-me\", expected an absolute path",
          "annunciator.modbus.lamp_coil: found 1, expected another coil than the horn's"})
        EXPECT_NE(said.find(part), std::string::npos) << part << "\n" << said;
}

TEST(GuardSettings, AKeyThatNeitherProgramKnowsIsRefusedWithItsPlace) {
    const auto said = refusal(kGuard + R"(anunciator.command = "/bin/page-me"
[annunciator]
comand = "/bin/page-me"
modbus = { host = "horn", horn_coils = 1 }
[can.signal]
accel_x = ""
[can.signals]
table_acel = ""
"accel_x.valid" = ""
[shaker.registers]
runs = { address = 3 }
run = { adress = 3 }
[shaker]
limits = 5
"h st\n" = 1
)");
    for (const char* part :
         {"rig.toml:3:1: anunciator: found an unknown table, expected one of accelerometer, "
          "annunciator, archive, campaign, can, ",
          "rig.toml:5:1: annunciator.comand: found an unknown key, expected one of command, "
          "command_limit_s, modbus\n",
          "rig.toml:6:27: annunciator.modbus.horn_coils: found an unknown key, expected one of "
          "horn_coil, host, lamp_coil, port, unit\n",
          "rig.toml:7:6: can.signal: found an unknown table, expected one of dbc, fd, ",
          "rig.toml:10:1: can.signals.table_acel: found an unknown key, expected one of accel_x, ",
          "rig.toml:11:1: can.signals.\"accel_x.valid\": found an unknown key",
          "rig.toml:13:1: shaker.registers.runs: found an unknown table, expected one of "
          "actual_frequency, amplitude",
          "rig.toml:14:9: shaker.registers.run.adress: found an unknown key, expected one of "
          "access, address, mask, scale, table, type, word_order\n",
          "rig.toml:16:10: shaker.limits: found 5, expected a table\n",
          "rig.toml:17:1: shaker.\"h st\\n\": found an unknown key, expected one of "})
        EXPECT_NE(said.find(part), std::string::npos) << part << "\n" << said;
    EXPECT_EQ(
        refusal("[guard]\nsokket = \"@g\"\nsocket = \"@g\"\n[commission]\nsimulated = true\n"),
        "rig.toml:2:1: guard.sokket: found an unknown key, expected socket\n");
}

TEST(GuardSettings, EveryKeyOfTheDaemonsMayBeThereAndNoneThatItDoesNotKnow) {
    const auto& keys = configuration::schema();
    for (const auto& key : keys)
        EXPECT_EQ(refusal(key.name + " = 0\n").find("unknown"), std::string::npos) << key.name;
    const auto daemon_knows = [&keys](const std::string& name) {
        return std::any_of(keys.begin(), keys.end(), [&name](const auto& key) {
            return key.name == name || key.name.starts_with(name + ".");
        });
    };
    for (const auto& name : keys_of_the_daemon()) EXPECT_TRUE(daemon_knows(name)) << name;
    for (const auto& name : tables_of_the_daemon()) EXPECT_TRUE(daemon_knows(name)) << name;
}

TEST(GuardSettings, WhatIsNoTomlIsReportedWithItsPlace) {
    EXPECT_EQ(refusal("[guard\n").rfind("rig.toml:1:7: not TOML: ", 0), 0u) << refusal("[guard\n");
    EXPECT_THROW((void)read_settings("/nowhere/rig.toml"), SettingsError);
}

}  // namespace
}  // namespace vibrig::guard
