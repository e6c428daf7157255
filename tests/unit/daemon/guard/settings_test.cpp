#include "daemon/guard/settings.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <map>
#include <sstream>

#include "daemon/configuration/configuration.hpp"

namespace vibrig::guard {
namespace {

const std::string kGuard = "[guard]\nsocket = \"/run/guard.sock\"\n";

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
[can]
port = "seqpacket"
path = "@bus"
fd = false
receive_buffer = 8192
sample_rate_hz = 100
[can.signals]
accel_x = "AccelerometersXY.Y"
accel_x_valid = ""
table_accel = ""
[campaign]
table_g = [2.0]
[shaker]
host = "192.168.1.40"
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

TEST(GuardSettings, FoldTheAmplitudesUnitIn) {
    const auto settings =
        parse_settings(kGuard +
                           "[shaker]\namplitude_unit = \"g_rms\"\n[shaker.registers]\n"
                           "measured_amplitude = { scale = 0.01 }\n",
                       "rig.toml");
    EXPECT_DOUBLE_EQ(settings.shaker.measured_amplitude.scale, 0.01 * std::sqrt(2.0));
}

TEST(GuardSettings, WithoutASocketThereIsNothingToMeetAt) {
    EXPECT_EQ(refusal(""),
              "rig.toml: guard.socket: found \"\" (default), expected an absolute path or "
              "\"@name\": vibrigd and the guard meet there\n");
    EXPECT_NE(refusal("[guard]\nsocket = \"guard.sock\"\n").find("rig.toml:2:10: guard.socket"),
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

TEST(GuardSettings, EachBadValueIsToldWithPlaceFoundAndExpected) {
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
          "rig.toml:5:18: can.sample_rate_hz: found nan, expected a number from 1 to 1000",
          "rig.toml:7:8: shaker.port: found 70000, expected a whole number from 1 to 65535",
          "rig.toml:8:8: shaker.host: found 5, expected a string",
          "rig.toml:10:9: shaker.registers.run.table: found \"input\", expected \"holding\"",
          "rig.toml:12:10: accelerometer.zero_g: found an array, expected 3 finite numbers",
          "rig.toml:14:11: annunciator.command: found \"page-me\", expected an absolute path",
          "annunciator.modbus.lamp_coil: found 1, expected another coil than the horn's"})
        EXPECT_NE(said.find(part), std::string::npos) << part << "\n" << said;
}

TEST(GuardSettings, WhatIsNoTomlIsToldWithItsPlace) {
    EXPECT_EQ(refusal("[guard\n").rfind("rig.toml:1:7: not TOML: ", 0), 0u) << refusal("[guard\n");
    EXPECT_THROW((void)read_settings("/nowhere/rig.toml"), SettingsError);
}

}  // namespace
}  // namespace vibrig::guard
