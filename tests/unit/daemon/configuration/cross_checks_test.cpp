#include <algorithm>
#include <filesystem>
#include <fstream>

#include "daemon/configuration/cross_checks.hpp"
#include "tests/unit/daemon/configuration/support.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::configuration {
namespace {

using ::testing::AllOf;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::StartsWith;

TEST(Together, ADaemonWithoutAWatchdogRegisterIsRefused) {
    const std::string text = "[shaker.registers]\nwatchdog = false\n";
    EXPECT_THAT(complaint(text, true),
                StartsWith("rig.toml:2:12: shaker.registers.watchdog: found no watchdog register"));
    // but identification from a recording moves nothing
    EXPECT_EQ(complaint(text, false), "");
    EXPECT_FALSE(accepted(text).shaker.registers.watchdog.has_value());
    EXPECT_EQ(complaint("shaker.registers.watchdog.address = 40", true), "");
    EXPECT_EQ(complaint("shaker.registers.watchdog = true", true), "");
}

TEST(Together, AnotherDbcUnderTheSameNameIsNotWhatWasProved) {
    const TemporaryFolder folder;
    const std::string path = folder.file("proved.dbc");
    const auto keys_with = [&](const std::string& contents) {
        std::ofstream(path) << contents;
        return accepted("can.dbc = \"" + path + "\"\n").campaign.proof.keys;
    };
    const std::string proved = keys_with("SG_ accel_x : 0|16@1- (0.001,0)");
    EXPECT_THAT(proved, HasSubstr("contents of can.dbc="));
    EXPECT_EQ(keys_with("SG_ accel_x : 0|16@1- (0.001,0)"), proved);
    EXPECT_NE(keys_with("SG_ accel_x : 0|16@1- (0.002,0)"), proved);
    std::filesystem::remove(path);
    EXPECT_THAT(accepted("can.dbc = \"" + path + "\"\n").campaign.proof.keys,
                HasSubstr("contents of can.dbc=unknown"));
    EXPECT_THAT(accepted("can.dbc = \"/\"\n").campaign.proof.keys,
                HasSubstr("contents of can.dbc=unknown"));
}

TEST(Together, AWatchdogThatWaitsLongerThanThreeSecondsIsRefused) {
    EXPECT_EQ(complaint("shaker.watchdog_period_ms = 1000\n", true), "");
    EXPECT_THAT(complaint("shaker.watchdog_period_ms = 1001\n", true),
                AllOf(StartsWith("rig.toml:1:29: shaker.watchdog_period_ms: found 1001 ms"),
                      HasSubstr("3.003 s after a daemon that died"), HasSubstr("1000 ms at most")));
    EXPECT_EQ(complaint("shaker.watchdog_period_ms = 20000\n", false), "");
}

TEST(Together, ReadBacksThatComeTooSeldomToSeeAnEmergencyStopAreRefused) {
    EXPECT_EQ(complaint("shaker.poll_period_ms = 500\n", true), "");
    EXPECT_THAT(complaint("shaker.poll_period_ms = 501\n", true),
                AllOf(StartsWith("rig.toml:1:25: shaker.poll_period_ms: found 501 ms"),
                      HasSubstr("expected 500 ms at most")));
    EXPECT_EQ(complaint("shaker.poll_period_ms = 60000\n", false), "");
}

TEST(Together, ALinkThatTriesAgainTooLateForAStopIsRefused) {
    EXPECT_EQ(complaint("shaker.backoff_min_ms = 1000\n", true), "");
    EXPECT_THAT(complaint("shaker.backoff_min_ms = 1001\n", true),
                StartsWith("rig.toml:1:25: shaker.backoff_min_ms: found 1001 ms, expected 1000 ms "
                           "at most"));
    EXPECT_EQ(complaint("shaker.backoff_min_ms = 5000\n", false), "");
}

TEST(Together, AWindowOfRestThatLeavesNoTimeToStopIsRefused) {
    const auto found = [](const std::string& window, const std::string& deadline) {
        return complaint(
            "shaker.rest_window_s = " + window + "\nshaker.stop_deadline_s = " + deadline + "\n",
            true);
    };
    EXPECT_EQ(found("2", "3"), "");
    EXPECT_EQ(found("0.5", "1"), "") << "the shortest deadline there is";
    EXPECT_EQ(found("10", "30"), "");
    EXPECT_THAT(found("5", "3"),
                AllOf(StartsWith("rig.toml:1:24: shaker.rest_window_s: found a window of rest of 5 "
                                 "s with stop_deadline_s 3, expected 2 s at most"),
                      testing::Not(HasSubstr("\n"))));
    EXPECT_THAT(found("0.6", "1"), HasSubstr("expected 0.5 s at most"));
    // 8 samples at least
    EXPECT_THAT(complaint("can.sample_rate_hz = 2\ncan.stale_deadline_ms = 2000\n", true),
                StartsWith("rig.toml:1:22: can.sample_rate_hz: found a window of rest of 4 s"));
    EXPECT_EQ(complaint("shaker.rest_window_s = 5\n", false), "");
}

TEST(Together, AHornWithoutItsDeviceIsRefused) {
    EXPECT_THAT(complaint("annunciator.modbus = { port = 502, horn_coil = 3 }\n", true),
                AllOf(StartsWith("rig.toml:1:31: annunciator.modbus.port: found it without"),
                      HasSubstr("expected the device's host as well")));
    EXPECT_EQ(complaint("annunciator.modbus = { host = \"127.0.0.1\", horn_coil = 3 }\n", true),
              "");
}

TEST(Together, MotionCannotBeCalledRest) {
    EXPECT_EQ(complaint("shaker.rest_g = 0.05\n", true), "");
    EXPECT_THAT(complaint("shaker.rest_g = 0.9\n", true), HasSubstr("shaker.rest_g: found 0.9"));
    EXPECT_THAT(complaint("selftest.transmission_tolerance = 0.5\n", true),
                HasSubstr("selftest.transmission_tolerance: found 0.5"));
}

TEST(Together, AnInterfaceWithADeviceIsHardware) {
    const TemporaryFolder folder;
    std::filesystem::create_directories(folder.file("can0/device"));
    std::filesystem::create_directories(folder.file("vcan0"));
    EXPECT_TRUE(is_hardware("can0", folder.file(".")));
    EXPECT_FALSE(is_hardware("vcan0", folder.file(".")));
    EXPECT_FALSE(is_hardware("none", folder.file(".")));
    EXPECT_FALSE(is_hardware("lo"));
}

TEST(Together, AWatchdogTimeoutThatCannotBeReadBackIsRefused) {
    EXPECT_THAT(complaint("shaker.registers.watchdog_timeout.access = \"write\"\n", true),
                HasSubstr("shaker.registers.watchdog_timeout.access: found \"write\", expected "
                          "\"read_write\""));
}

TEST(Together, ALimitOfRestBelowTheNoiseIsRefused) {
    EXPECT_THAT(
        complaint("noise.accelerometer_g = 0.004\nshaker.rest_g = 0.02\n", true),
        StartsWith("rig.toml:2:17: shaker.rest_g: found 0.02 g, expected 0.024 g at least"));
    EXPECT_THAT(complaint("noise.accelerometer_g = 0.004\n", true),
                HasSubstr("noise.accelerometer_g: found 0.02 g, expected 0.024 g at least"));
    EXPECT_EQ(complaint("noise.accelerometer_g = 0.003\n", true), "");
    EXPECT_EQ(complaint("noise.accelerometer_g = 0.004\n", false), "");
}

TEST(Together, TheRigsClockNeedsASimulatedBusAndALoopbackShaker) {
    const std::string rig = "clock.source = \"rig\"\n";
    const std::string seqpacket = "can.port = \"seqpacket\"\ncan.path = \"@rig\"\n";
    EXPECT_THAT(complaint(rig, true), HasSubstr("rig.toml:1:16: clock.source: found \"rig\" on the "
                                                "CAN interface can0"));
    EXPECT_EQ(complaint(rig + seqpacket, true), "");
    EXPECT_EQ(complaint(rig + "can.interface = \"vcan0\"", true), "");
    EXPECT_EQ(complaint(rig + "can.interface = \"vxcan1\"", true), "");
    for (const char* host : {"localhost", "127.0.0.1", "127.1.2.3", "::1"}) {
        EXPECT_EQ(complaint(rig + seqpacket + "shaker.host = \"" + host + "\"", true), "") << host;
    }
    for (const char* host : {"10.0.0.1", "127.evil.example", "localhost.example", "1.127.0.0"}) {
        EXPECT_THAT(complaint(rig + seqpacket + "shaker.host = \"" + host + "\"", true),
                    HasSubstr("expected shaker.host on loopback"))
            << host;
    }
    EXPECT_THAT(
        complaint(rig + seqpacket + "shaker.transport = \"rtu\"\nshaker.device = \"/dev/x\"", true),
        HasSubstr("a serial line"));
}

TEST(Together, APlatformSaysSomethingOfItself) {
    const std::string silent =
        "can.signals = { ready = \"\", loop_closed = \"\", gyros_at_speed = \"\", fault = \"\" }";
    EXPECT_THAT(complaint(silent, true), HasSubstr("is never ready"));
    EXPECT_EQ(complaint(silent, false), "") << "the daemon alone needs it";
}

TEST(Together, ThePageIsForThisMachineAlone) {
    for (const char* page : {"127.0.0.1:8979", "[::1]:0", "localhost:8979", "127.1.2.3:1"})
        EXPECT_EQ(complaint(std::string("server.page = \"") + page + "\"", true), "") << page;
    for (const char* page : {"0.0.0.0:8979", "[::]:8979", "10.0.0.7:8979", "127.evil.example:1"})
        EXPECT_THAT(complaint(std::string("server.page = \"") + page + "\"", true),
                    AllOf(StartsWith(std::string("rig.toml:1:15: server.page: found \"") + page),
                          HasSubstr("expected this machine's loopback")))
            << page;
}

TEST(Together, AnArchiveThatNothingReachesIsRefused) {
    const std::string index = "archive.index = \"postgresql://db.lab/a\"\n";
    const std::string folder = "archive.folder = \"/lab\"\n";
    EXPECT_EQ(complaint(index + folder, true), "");
    EXPECT_THAT(complaint(index, true),
                AllOf(StartsWith("rig.toml:1:17: archive.index: found \"postgresql://db.lab/a\" "
                                 "without archive.folder"),
                      HasSubstr("nothing is delivered")));
    EXPECT_THAT(complaint(folder + "record.enabled = false\n", true),
                AllOf(StartsWith("rig.toml:1:18: archive.folder: found an archive with "
                                 "record.enabled = false"),
                      HasSubstr("cannot be delivered")));
}

TEST(Together, RemoteNeedsCertificates) {
    const std::string remote = "[server]\nremote = \"0.0.0.0:8443\"\n";
    const std::string certificate = "certificate = \"rig.crt\"\n", key = "key = \"rig.key\"\n";
    const std::string authority = "clients_ca = \"authority.crt\"\n";
    EXPECT_EQ(complaint(remote + certificate + key + authority, true), "");
    EXPECT_EQ(complaint(remote, false), "") << "a recording needs no server";
    EXPECT_THAT(complaint(remote + key + authority, true),
                AllOf(StartsWith("rig.toml:2:10: server.remote: found \"0.0.0.0:8443\" without "
                                 "server.certificate"),
                      HasSubstr("expected a file in PEM")));
    EXPECT_THAT(complaint(remote + certificate + authority, true), HasSubstr("without server.key"));
    EXPECT_THAT(complaint(remote + certificate + key, true),
                HasSubstr("without server.clients_ca"));
}

TEST(Together, SetPointsBeyondTheShakerAreRefusedWithTheNumbers) {
    // a / (2 pi f)^2 = 9 * 9.80665 / 94.248^2 = 9.9362 mm, a / (2 pi f) = 0.93647 m/s
    EXPECT_THAT(
        complaint("shaker.limits.displacement_mm = 9.9", true),
        AllOf(StartsWith("rig.toml:1:33: shaker.limits.displacement_mm: found 9 g at 15 Hz"),
              HasSubstr("9.9362 mm peak"), HasSubstr("9.9 mm at most")));
    EXPECT_EQ(complaint("shaker.limits.displacement_mm = 9.94", true), "");
    EXPECT_THAT(complaint("shaker.limits.velocity_mps = 0.93", true),
                HasSubstr("0.93647 m/s peak"));
    EXPECT_EQ(complaint("shaker.limits.velocity_mps = 0.94", true), "");
    EXPECT_THAT(complaint("[campaign]\ntable_g = [7, 13]", true),
                AllOf(StartsWith("rig.toml:2:11: campaign.table_g: found 13 g at 15 Hz"),
                      HasSubstr("12 g at most (shaker.limits.acceleration_g)")));
    // at another frequency the same acceleration is another stroke
    EXPECT_THAT(complaint("vibration.frequency_hz = 11", true), HasSubstr("18.476 mm peak"));
    EXPECT_EQ(complaint("campaign.table_g = [13]", false), "") << "a recording moves nothing";
}

TEST(Together, FrequenciesThatAliasToZeroAreRefused) {
    const std::string no_stroke = "campaign.table_g = [1]\ncampaign.resonance_hz = 5\n";
    // at 40 samples/s and a 10 s window: f, or a harmonic of it to the fifth, within 0.4 Hz of a
    // multiple of 40 Hz
    for (const char* f : {"19.9", "20", "20.15", "39.85", "40", "60", "24", "56", "40.3", "39.7",
                          "13.3", "10.05"}) {
        EXPECT_THAT(complaint(no_stroke + "vibration.frequency_hz = " + f, true),
                    HasSubstr("a harmonic of it falls on a multiple of the rate"))
            << f;
    }
    EXPECT_THAT(complaint(no_stroke + "vibration.frequency_hz = 40.3", true),
                HasSubstr("the nearest free one is 40.4 Hz"));
    for (const char* f : {"15", "19.7", "20.3", "39.5"}) {
        EXPECT_EQ(complaint(no_stroke + "vibration.frequency_hz = " + f, true), "") << f;
    }
    // a shorter window has wider side bands
    EXPECT_THAT(complaint(no_stroke + "vibration.frequency_hz = 19.5\n"
                                      "vibration.level_window_s = 2",
                          true),
                HasSubstr("the nearest free one is"));
    EXPECT_EQ(complaint("vibration.frequency_hz = 20\ncampaign.table_g = [0]", true), "")
        << "at rest there is no frequency";
}

TEST(Together, TheIsolatorsResonanceIsRefused) {
    EXPECT_THAT(complaint("campaign.resonance_hz = 11", true),
                HasSubstr("expected 15.556 Hz at least, sqrt(2) times"));
    EXPECT_EQ(complaint("campaign.resonance_hz = 10.6", true), "");
    EXPECT_THAT(complaint("vibration.transmission = 1.5", true),
                HasSubstr("found 1.5 at 15 Hz, expected 1 at most"));
    EXPECT_EQ(complaint("vibration.transmission = 1", true), "") << "a rigid mount";
}

TEST(Together, RegistersThatAreWrittenMustBeWritableAndApart) {
    const std::string registers = "[shaker.registers]\n";
    EXPECT_THAT(complaint(registers + "run.table = \"input\""),
                HasSubstr("shaker.registers.run.table: found \"input\", expected \"holding\""));
    EXPECT_THAT(complaint(registers + "amplitude.access = \"read\""),
                HasSubstr("expected \"write\" or \"read_write\""));
    EXPECT_THAT(complaint(registers + "state.access = \"write\""),
                HasSubstr("expected \"read\" or \"read_write\""));
    EXPECT_THAT(complaint(registers + "frequency.type = \"bits\""), HasSubstr("a number: u16"));
    EXPECT_THAT(complaint(registers + "frequency.address = 65535"),
                HasSubstr("found 65535 for 2 words, expected 65534 at most"));
    // frequency takes 1 and 2, the amplitude begins at 2
    EXPECT_THAT(complaint(registers + "frequency.address = 1"),
                HasSubstr("rig.toml:2:21: shaker.registers.frequency.address: found amplitude at 2 "
                          "over frequency at 1"));
    // bits of one status register may be read twice
    EXPECT_EQ(complaint(registers + "fault.address = 0"), "");
}

TEST(Together, SetPointsMustFitTheirRegisters) {
    // u16 at 1e-4 g ends at 6.5535 g
    EXPECT_THAT(
        complaint("shaker.registers.amplitude.type = \"u16\"", true),
        HasSubstr("found 9 g to be written, expected a register that holds it (6.5535 g at"));
    EXPECT_THAT(complaint("shaker.registers.ramp_time.scale = 1e-5", true),
                HasSubstr("found 2 s to be written"));
    EXPECT_EQ(complaint("shaker.registers.amplitude.type = \"u16\"\n"
                        "shaker.registers.amplitude.scale = 1e-3",
                        true),
              "");
}

TEST(Together, ContradictionsAreRefused) {
    EXPECT_THAT(complaint("can.port = \"seqpacket\""), HasSubstr("\"seqpacket\" without can.path"));
    EXPECT_THAT(complaint("shaker.transport = \"rtu\"", true), HasSubstr("without shaker.device"));
    EXPECT_THAT(complaint("shaker.backoff_min_ms = 6000"), HasSubstr("backoff_min_ms <= "));
    EXPECT_THAT(complaint("can.stale_deadline_ms = 20"), HasSubstr("found stale_deadline_ms"));
    EXPECT_THAT(complaint("can.sample_rate_hz = 8"),
                HasSubstr("can.sample_rate_hz: found stale_deadline_ms of 100, expected more than "
                          "one sample period, 125 ms"));
    // Slower no second shows gravity, before each ramp, and levelling has no news for a second.
    const std::string slow =
        "can.stale_deadline_ms = 1500\nshaker.stop_deadline_s = 20\ncampaign.table_g = [0.0]\n";
    EXPECT_THAT(complaint(slow + "can.sample_rate_hz = 4\ncampaign.levelling = true\n", true),
                HasSubstr("can.sample_rate_hz: found 4, expected 5 at least"));
    EXPECT_THAT(complaint(slow + "can.sample_rate_hz = 5\n", true),
                Not(HasSubstr("can.sample_rate_hz")));
    EXPECT_THAT(complaint(slow + "can.sample_rate_hz = 1\n", false),
                Not(HasSubstr("can.sample_rate_hz")))
        << "a recording is read as it is";
    EXPECT_THAT(complaint("shaker.unit = 250"), HasSubstr("1 to 247, or 255"));
    EXPECT_THAT(complaint("campaign.ready_timeout_s = 30", true), HasSubstr("a window shorter"));
    EXPECT_THAT(complaint("can.signals.temperature = \"\"", true),
                HasSubstr("0 where no temperature is known"));
}

TEST(Together, AMistakeInAValueIsReportedOnce) {
    // GIVEN a frequency that is no frequency
    const std::string text = complaint("vibration.frequency_hz = nan", true);
    // THEN limits, aliasing and resonance at it are not discussed
    EXPECT_EQ(text.find('\n'), std::string::npos) << text;
}

TEST(InterlockTable, TakesRowsByNameAndKeepsTheOthers) {
    const auto before = accepted("").interlock;
    const auto rows = accepted(R"(
[[interlock]]
name = "amplitude_abort"
limit = 3
dwell_s = 2
[[interlock]]
name = "too_hot"
condition = "temperature"
reaction = "alarm"
limit = 60.5
latched = true
[[interlock]]
name = "tilt"
reaction = "off"
)")
                          .interlock;
    ASSERT_EQ(rows.size(), before.size() + 1);
    const auto row = [&rows](const std::string& name) {
        return *std::find_if(rows.begin(), rows.end(),
                             [&name](const rt::Rule& rule) { return rule.name == name; });
    };
    EXPECT_EQ(row("amplitude_abort").limit, 3);
    EXPECT_EQ(row("amplitude_abort").dwell_s, 2);
    EXPECT_EQ(row("amplitude_abort").reaction, rt::Reaction::abort);
    EXPECT_EQ(row("too_hot").condition, rt::Trip::temperature);
    EXPECT_TRUE(row("too_hot").latched);
    EXPECT_EQ(row("tilt").reaction, rt::Reaction::off);
    EXPECT_EQ(row("emergency_stop").reaction, rt::Reaction::abort);
}

TEST(InterlockTable, RefusesWhatWouldNotProtect) {
    struct Case {
        const char *row, *says;
    };
    const std::string head = "[[interlock]]\n";
    for (const Case& c : {
             Case{"name = \"emergency_stop\"\nreaction = \"alarm\"",
                  "interlock[0].reaction: found \"alarm\" (a string), expected \"abort\""},
             Case{"name = \"can_lost\"\ndwell_s = 0.1", "interlock[0].dwell_s: found 0.1"},
             Case{"name = \"wrong_vibration\"\ndwell_s = 0.1", "interlock[0].dwell_s: found 0.1"},
             Case{"name = \"loop_open\"\ndwell_s = 1.1", "a number from 0 to 1 s"},
             Case{"name = \"tilt\"\nlimit = nan", "interlock[0].limit: found nan"},
             Case{"name = \"tilt\"\nlatched = false", "an abort latches until acknowledged"},
             Case{"name = \"tilt\"\ncondition = \"disk\"", "which the row of this name watches"},
             Case{"name = \"stale_channel\"\nlimit = 1", "has no limit of its own"},
             Case{"name = \"mine\"", "interlock[0].condition: found nothing"},
             Case{"name = \"mine\"\ncondition = \"tilt\"", "interlock[0].limit: found nothing"},
             Case{"condition = \"tilt\"", "interlock[0].name: found nothing"},
             Case{"name = \"tilt\"\nlimits = 1", "interlock[0].limits: found an unknown key"},
             Case{"name = \"tilt\"\n[[interlock]]\nname = \"tilt\"", "\"tilt\" again"},
         }) {
        EXPECT_THAT(complaint(head + c.row), testing::HasSubstr(c.says)) << c.row;
    }
    EXPECT_THAT(complaint("interlock = 1"), testing::HasSubstr("[[interlock]] tables"));
    EXPECT_THAT(complaint("[interlock]\nname = 1"), testing::HasSubstr("[[interlock]] tables"));
}

}  // namespace
}  // namespace vibrig::configuration
