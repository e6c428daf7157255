// What is demanded of a rig that can hurt somebody, on the real clock.
#include <string>

#include "daemon/configuration/warnings.hpp"
#include "tests/unit/daemon/configuration/support.hpp"

namespace vibrig::configuration {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

const std::string kMap = R"(
[shaker.registers]
frequency = { address = 100, type = "u32", word_order = "big", scale = 1e-3 }
amplitude = { address = 102, type = "u32", word_order = "big", scale = 1e-4 }
ramp_time = { address = 104, type = "u16", scale = 1e-2 }
run = { address = 105, type = "u16" }
watchdog = { address = 106, type = "u16" }
watchdog_timeout = { address = 107, type = "u16", scale = 1e-3 }
state = { address = 100, type = "u16", table = "input" }
fault = { address = 101, type = "u16", table = "input" }
emergency_stop = { address = 102, type = "bits", table = "input", mask = 1 }
measured_amplitude = { address = 103, type = "f32", word_order = "little", table = "input", scale = 1 }
)";

/// As complaint(), on the real clock.
std::string real_complaint(const std::string& text) {
    try {
        static_cast<void>(parse(text, "rig.toml", true));
    } catch (const ConfigurationError& error) {
        return error.what();
    }
    return "";
}

std::string with(std::string text, const std::string& from, const std::string& to) {
    const auto at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

TEST(RealRig, WithAStatedMapIsAccepted) { EXPECT_EQ(real_complaint(kMap), ""); }

TEST(RealRig, NoRegisterHasADefault) {
    // GIVEN no [shaker.registers] at all
    const std::string text = real_complaint("");
    // THEN each is named
    for (const char* role : {"frequency", "amplitude", "ramp_time", "run", "watchdog",
                             "watchdog_timeout", "state", "fault", "emergency_stop"})
        EXPECT_THAT(text, HasSubstr(std::string("shaker.registers.") + role + ": found nothing"));
    EXPECT_THAT(text, HasSubstr("Vibrig's own map is for the simulated rig only"));
    // AND so is the one that is missing
    const auto one = real_complaint(with(kMap, "run = { address = 105, type = \"u16\" }\n", ""));
    EXPECT_THAT(one, AllOf(HasSubstr("shaker.registers.run: found nothing"),
                           Not(HasSubstr("shaker.registers.state"))));
    // AND a part of one that would be taken from Vibrig's own map
    struct Case {
        const char *from, *to, *key;
    };
    for (const Case& c : {
             Case{"105, type = \"u16\"", "105", "shaker.registers.run.type"},
             Case{"address = 104, ", "", "shaker.registers.ramp_time.address"},
             Case{"type = \"u16\", scale = 1e-2", "type = \"u16\"",
                  "shaker.registers.ramp_time.scale"},
             Case{"word_order = \"big\", scale = 1e-4", "scale = 1e-4",
                  "shaker.registers.amplitude.word_order"},
             // A float in g that is taken for 1e-4 g would be at rest at 5 g.
             Case{"\"input\", scale = 1 ", "\"input\" ",
                  "shaker.registers.measured_amplitude.scale"},
             Case{", mask = 1", "", "shaker.registers.emergency_stop.mask"},
             Case{"word_order = \"little\", ", "", "shaker.registers.measured_amplitude.word_or"},
             Case{"101, type = \"u16\", table = \"input\"", "101, type = \"u16\"",
                  "shaker.registers.fault.table"},
         })
        EXPECT_THAT(real_complaint(with(kMap, c.from, c.to)), HasSubstr(c.key)) << c.key;
    // BUT a program has Vibrig's own map, and a recording needs none
    EXPECT_EQ(real_complaint("commission.simulated = true"), "");
    EXPECT_EQ(complaint("", false), "");
}

TEST(RealRig, TwoGyrosOnOneInputAxisAreRefused) {
    const std::string axes = "platform.gyro_y_axes = [\"+x\", \"+y\", \"+z\"]\n";
    EXPECT_THAT(real_complaint(axes + kMap),
                HasSubstr("platform.gyro_y_axes[0]: found \"+x\", the input axis of gyro x too, "
                          "expected \"+y\" or \"-y\": gyro y drifts about platform y"));
    EXPECT_EQ(complaint(axes, false), "") << "a recording: identify warns";
    // BUT of a simulated rig it is a warning, with its place
    EXPECT_THAT(
        warnings(parse(as_simulated(axes, true), "rig.toml", true)),
        ElementsAre("rig.toml:1: platform.gyro_y_axes[0]: found \"+x\", the input axis of "
                    "gyro x too, expected \"+y\" or \"-y\": gyro y drifts about platform y"));
    // the letter of another gyro, though no two are alike
    const std::string swapped =
        "platform.gyro_x_axes = [\"+y\", \"+z\", \"+x\"]\n"
        "platform.gyro_y_axes = [\"+x\", \"+y\", \"+z\"]\n";
    EXPECT_THAT(real_complaint(swapped + kMap),
                AllOf(HasSubstr("platform.gyro_x_axes[0]"), HasSubstr("platform.gyro_y_axes[0]")));
}

TEST(RealRig, ALeftHandedTriadIsRefused) {
    const std::string axes = "platform.gyro_z_axes = [\"+z\", \"+y\", \"+x\"]\n";
    EXPECT_THAT(
        real_complaint(axes + kMap),
        HasSubstr(R"(platform.gyro_z_axes: found ["+z", "+y", "+x"], left-handed, expected )"
                  R"(a right-handed triad, input cross output is spin: by the drawing )"
                  R"(["+z", "-y", "+x"], ["+z", "+y", "-x"], or output and spin )"
                  R"(axis exchanged)"));
    EXPECT_THAT(warnings(parse(as_simulated(axes, true), "rig.toml", true)),
                ElementsAre(AllOf(HasSubstr("rig.toml:1: platform.gyro_z_axes: found "),
                                  HasSubstr("left-handed"))));
    EXPECT_THAT(warnings(parse(as_simulated("", true), "rig.toml", true)), IsEmpty());
    // THEN what it proposes is taken, each of it
    EXPECT_EQ(real_complaint("platform.gyro_z_axes = [\"+z\", \"-y\", \"+x\"]\n" + kMap), "");
    EXPECT_EQ(real_complaint("platform.gyro_z_axes = [\"+z\", \"+y\", \"-x\"]\n" + kMap), "");
    EXPECT_EQ(real_complaint("platform.gyro_z_axes = [\"+z\", \"+x\", \"+y\"]\n" + kMap), "");
    EXPECT_EQ(real_complaint("platform.gyro_z_axes = [\"-z\", \"+y\", \"+x\"]\n" + kMap), "");
}

TEST(RealRig, ALeftHandedTriadOfAccelerometersIsDescribedByItsMatrix) {
    EXPECT_EQ(real_complaint("accelerometer.matrix = [[1, 0, 0], [0, 1, 0], [0, 0, -1]]\n" + kMap),
              "");
}

TEST(RealRig, MotionAcrossTheVerticalIsMeasuredOrDeclared) {
    // GIVEN a rig that measures along the vertical only
    const std::string vertical = "platform.second_moment = \"vertical\"\n";
    EXPECT_THAT(real_complaint(vertical + kMap),
                HasSubstr("rig.toml:1:26: platform.second_moment: found \"vertical\" without "
                          "uncertainty.cross_axis, expected uncertainty.cross_axis declared"));
    EXPECT_THAT(warnings(parse(as_simulated(vertical, true), "rig.toml", true)),
                ElementsAre(HasSubstr("rig.toml:1: platform.second_moment: found \"vertical\"")));
    EXPECT_EQ(complaint(vertical, false), "") << "a recording: identify warns";
    // THEN one that states what it does not see is fine
    EXPECT_EQ(real_complaint(vertical + "uncertainty.cross_axis = [0.01, 0.02]\n" + kMap), "");
}

TEST(RealRig, ARangeBelowWhatTheCampaignMakesIsRefused) {
    // 1 + 0.6667 x 9 = 7.0003 g
    EXPECT_THAT(real_complaint("accelerometer.range_g = 7\n" + kMap),
                HasSubstr("accelerometer.range_g: found 7 g, expected 7.0003 g at least"));
    EXPECT_EQ(real_complaint("accelerometer.range_g = 7.01\n" + kMap), "");
    EXPECT_EQ(real_complaint("accelerometer.range_g = 0\n" + kMap), "") << "not known";
}

TEST(RealRig, WhatIsSeenAfterAMinuteIsRefused) {
    const std::string rtu = "shaker.transport = \"rtu\"\nshaker.device = \"/dev/ttyUSB0\"\n";
    const std::string stale = "can.stale_deadline_ms = ", status = "gimbal.status_deadline_ms = ",
                      answer = "shaker.response_timeout_ms = ";
    EXPECT_EQ(real_complaint(stale + "1000\n" + status + "1000\n" + answer + "1000\n" + kMap), "");
    EXPECT_EQ(real_complaint(rtu + answer + "500\n" + kMap), "");
    EXPECT_THAT(real_complaint(stale + "60000\n" + kMap),
                StartsWith("rig.toml:1:25: can.stale_deadline_ms: found 60000 ms, expected 1000 ms "
                           "at most"));
    EXPECT_THAT(real_complaint(status + "1001\n" + kMap),
                StartsWith("rig.toml:1:29: gimbal.status_deadline_ms: found 1001 ms, expected 1000 "
                           "ms at most"));
    EXPECT_THAT(real_complaint(answer + "1001\n" + kMap),
                StartsWith("rig.toml:1:30: shaker.response_timeout_ms: found 1001 ms, expected "
                           "1000 ms at most"));
    EXPECT_THAT(real_complaint(rtu + answer + "501\n" + kMap),
                HasSubstr("expected 500 ms at most"));
    // BUT a program may be late, a recording is read as it is, and a slow bus has two periods
    EXPECT_EQ(complaint(stale + "10000\n" + status + "10000\n" + answer + "5000\n", true), "");
    EXPECT_EQ(complaint(stale + "60000\n", false), "");
    EXPECT_THAT(real_complaint("can.sample_rate_hz = 1\n" + stale + "2000\n" + kMap),
                Not(HasSubstr("stale_deadline_ms")));
}

TEST(Positions, AreGimbalAnglesAndConvertedByEncoderSignAndZero) {
    // GIVEN encoders that count their own way
    const std::string encoders =
        "platform.encoder_sign = [1, -1, 1]\nplatform.encoder_zero_deg = [131.4, -4, 77.3]\n";
    const auto stated =
        accepted(encoders + "campaign.positions_deg = [[0, 10, 0], [90, 0, 180]]", true);
    const auto& at = stated.campaign.positions_deg;
    // THEN what is commanded is the reading of the attitude: sign * angle + zero
    EXPECT_NEAR(at[0][0], 131.4, 1e-9);
    EXPECT_NEAR(at[0][1], -14, 1e-9);
    EXPECT_NEAR(at[0][2], 77.3, 1e-9);
    EXPECT_NEAR(at[1][0], -138.6, 1e-9);
    EXPECT_NEAR(at[1][2], -102.7, 1e-9);
    // AND so for the default list, Table 1
    EXPECT_NEAR(accepted(encoders, true).campaign.positions_deg[0][0], 131.4, 1e-9);
    // AND what is printed is what was stated
    for (const auto& value : parse(as_simulated(encoders, true), "f", true).effective) {
        if (value.key == "campaign.positions_deg") {
            EXPECT_EQ(value.value.rfind("[[0.0, 0.0, 0.0], ", 0), 0U) << value.value;
        }
    }
    // BUT encoders that count as the gimbals do get what was stated, to the last digit
    EXPECT_EQ(accepted("", true).campaign.positions_deg, campaign::kTable1Positions);
}

TEST(Positions, BeyondTheTravelAreRefused) {
    const std::string travel = "gimbal.travel_deg = [[-130, 130], [-30, 30], [-175, 175]]\n";
    EXPECT_THAT(complaint(travel, true),
                HasSubstr("position 4 at a reading of 180 deg of the azimuth gimbal, expected -175 "
                          "to 175 deg"));
    EXPECT_EQ(complaint(travel + "campaign.positions_deg = [[-90, 0, 270]]", true), "");
    EXPECT_THAT(complaint("gimbal.travel_deg = [[-130, 130], [30, -30], [-175, 175]]"),
                HasSubstr("gimbal.travel_deg[1]: found [30, -30], expected the lowest"));
    EXPECT_THAT(complaint("gimbal.travel_deg = [1, 2, 3]"), HasSubstr("gimbal.travel_deg[0]"));
    EXPECT_THAT(complaint("site.elevation_deg = 2.1"), HasSubstr("site.elevation_deg: found 2.1"));
}

/// What becomes of [zeroing] on a rig of which `more` is said.
auto zeroing_of(const std::string& more) {
    return accepted(
               "campaign = { zeroing = true, positions_deg = [[0, 0, 0]], identify = "
               "\"what-it-can\" }\n" +
                   more,
               true)
        .campaign.zero;
}

TEST(Zeroing, IsBothWaysWhereTheOuterGimbalTurnsThatFar) {
    const auto of = [](const std::string& more) { return zeroing_of(more).both_ways; };
    // Platform y is up at zero angles: the azimuth axis is upright at 90 and at -90 deg.
    EXPECT_TRUE(of(""));
    EXPECT_TRUE(of("gimbal.travel_deg = [[-95, 95], [-30, 30], [-175, 175]]"));
    EXPECT_FALSE(of("gimbal.travel_deg = [[-80, 95], [-30, 30], [-175, 175]]"));
    // AND as the encoder counts
    EXPECT_TRUE(
        of("gimbal.travel_deg = [[20, 210], [-30, 30], [-175, 175]]\n"
           "platform.encoder_zero_deg = [115, 0, 0]"));
    // BUT what is stated holds, and is refused later where it cannot be
    EXPECT_TRUE(
        of("gimbal.travel_deg = [[-80, 95], [-30, 30], [-175, 175]]\n"
           "zeroing.both_ways = true"));
    EXPECT_FALSE(of("zeroing.both_ways = false"));
}

TEST(Zeroing, TakesASecondAxisWhereZCannotBeDown) {
    const auto of = [](const std::string& more) { return zeroing_of(more).second_axis; };
    EXPECT_FALSE(of(""));
    // z down is out of reach, y is not: the inner gimbal has its 60 deg, the azimuth its half turn
    EXPECT_TRUE(of("gimbal.travel_deg = [[-80, 95], [-65, 65], [-180, 180]]"));
    EXPECT_FALSE(of("gimbal.travel_deg = [[-80, 95], [-55, 65], [-180, 180]]"));
    EXPECT_FALSE(of("gimbal.travel_deg = [[-80, 95], [-65, 65], [-175, 175]]"));
    // AND as the encoders count
    EXPECT_TRUE(
        of("gimbal.travel_deg = [[-60, 115], [-65, 65], [-180, 180]]\n"
           "platform.encoder_zero_deg = [20, 0, 0]"));
    // BUT what is stated holds
    EXPECT_FALSE(
        of("gimbal.travel_deg = [[-80, 95], [-65, 65], [-180, 180]]\n"
           "zeroing.both_ways = false"));
    EXPECT_TRUE(of("zeroing.second_axis = true"));
}

TEST(OpeningCheck, BeginsTheCampaignsOfRigsThatAreArmedByTheRecord) {
    const auto first = [](const std::string& text) {
        return parse(text, "rig.toml", true).configuration.campaign.open_first;
    };
    EXPECT_FALSE(first("[commission]\nsimulated = true\n"));
    EXPECT_TRUE(first(kMap));
    EXPECT_FALSE(first("commission.opening_check = false\n" + kMap));
    const auto of = [](const std::string& text) {
        return parse(text, "rig.toml", true).configuration.campaign.opening;
    };
    // Alone it is made of every rig.
    EXPECT_EQ(of("[commission]\nsimulated = true\n").size(), 5U);
    EXPECT_EQ(of(kMap).size(), 5U);
    // AND it looks where the travel allows it: as the encoders count, this way up or that
    const auto stops =
        of("gimbal.travel_deg = [[-130, 80], [-30, 30], [-160, 175]]\n"
           "platform.encoder_zero_deg = [0, 0, 10]\n"
           "campaign = { positions_deg = [[0, 0, 0]], identify = \"what-it-can\" }\n" +
           kMap);
    ASSERT_EQ(stops.size(), 4U) << "190 deg are not reached";
    EXPECT_EQ(stops[0].position_deg, (std::array{-90.0, 0.0, 10.0}));
    EXPECT_EQ(stops[1].position_deg, (std::array{-90.0, 0.0, 100.0}));
    EXPECT_EQ(stops[2].position_deg, (std::array{-90.0, 0.0, -80.0}));
    EXPECT_TRUE(stops[2].drifts);
    EXPECT_EQ(stops[3].position_deg, (std::array{60.0, 15.0, 100.0}));
    EXPECT_FALSE(stops[3].drifts);
}

}  // namespace
}  // namespace vibrig::configuration
