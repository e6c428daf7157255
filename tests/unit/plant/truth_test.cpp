#include "tests/plant/truth.hpp"

#include <gtest/gtest.h>

#include <string>

#include "tests/unit/plant/replaced.hpp"

namespace vibrig::plant {
namespace {

std::string complaint(const std::string& json) {
    try {
        static_cast<void>(parse_truth(json, "truth.json"));
    } catch (const PlantError& error) {
        return error.what();
    }
    return "none";
}

TEST(Truth, SurvivesWritingAndReading) {
    Truth truth;
    truth.coefficients[2][kOS] = 0.123456789012345;
    truth.up = {2, -1};
    truth.matrix[0][1] = 2.4e-4;
    truth.seed = 0xffffffffffffffffULL;
    truth.shaker_lies.stuck_contactor = true;
    truth.step_at_s = 1e3;
    truth.dead = Axis{2, 1};
    truth.stuck_gimbal = GimbalAxis::inner;
    truth.angle_unit[2] = AngleUnit::gon;
    truth.channel = {GimbalAxis::azimuth, GimbalAxis::outer, GimbalAxis::inner};
    truth.cross_axis = {0.05, -0.1};
    truth.cubic_deg_h_g3[2] = {1e-3, 2e-3, 3e-3};
    truth.shaker_lies.timeout_register = 0;
    truth.map = "/etc/a map.toml";
    const std::string json = to_json(truth);
    EXPECT_EQ(to_json(parse_truth(json, "truth.json")), json);
    EXPECT_EQ(parse_truth(json, "truth.json").coefficients, truth.coefficients);
    EXPECT_EQ(parse_truth(json, "truth.json").shaker_lies.timeout_register, 0);
    EXPECT_EQ(parse_truth(json, "truth.json").map, "/etc/a map.toml");
    truth.map = "map.toml";
    EXPECT_EQ(parse_truth(to_json(truth), "/here/truth.json").map, "/here/map.toml");
    EXPECT_FALSE(
        parse_truth(to_json(Truth{}), "truth.json").shaker_lies.timeout_register.has_value());
}

TEST(Truth, DefaultIsTable2) {
    const Truth truth;
    EXPECT_EQ(truth.coefficients[0][kF], 1);
    EXPECT_EQ(truth.coefficients[0][kI], -1);
    EXPECT_EQ(truth.coefficients[0][kS], 1);
    EXPECT_EQ(truth.coefficients[0][kO], -1);
    EXPECT_EQ(truth.coefficients[1][kII], -0.03);
    EXPECT_EQ(truth.coefficients[1][kSS], 0.03);
    EXPECT_EQ(truth.coefficients[1][kOO], -0.03);
    EXPECT_EQ(truth.coefficients[2][kIS], -0.03);
    EXPECT_EQ(truth.coefficients[2][kIO], 0.03);
    EXPECT_EQ(truth.coefficients[2][kOS], -0.03);
    EXPECT_EQ(coefficient_name(1, kSS), "D_SSy");
    EXPECT_EQ(coefficient_unit(kF), "deg/h");
    EXPECT_EQ(coefficient_unit(kS), "deg/h/g");
    EXPECT_EQ(coefficient_unit(kII), "deg/h/g^2");
}

TEST(Truth, NamesTheKeyOfBadInput) {
    const std::string good = to_json(Truth{});
    EXPECT_EQ(complaint(good), "none");
    const auto expect = [](const std::string& json, const char* part) {
        EXPECT_NE(complaint(json).find(part), std::string::npos) << complaint(json);
    };
    expect(replaced(good, "\"D_OSy\"", "\"D_OSq\""), "coefficients.D_OSy: missing");
    expect(replaced(good, "\"D_Fx\": 1.0", "\"D_Fx\": 1.0, \"D_Fw\": 2"),
           "coefficients.D_Fw: unknown key");
    expect(replaced(good, "\"D_Fx\": 1.0", "\"D_Fx\": null"), "coefficients.D_Fx: found null");
    expect(replaced(good, "\"D_Fx\": 1.0", "\"D_Fx\": 1e999"), "truth.json");
    expect(replaced(good, "\"latitude_deg\"", "\"lattitude_deg\""),
           "site.lattitude_deg: unknown key");
    expect(replaced(good, "\"latitude_deg\": 45.75", "\"latitude_deg\": 95"),
           "site.latitude_deg: found 95");
    expect(replaced(good, "\"noise\"", "\"nois\""), "nois: unknown key");
    expect(replaced(good, "\"up\": \"+y\"", "\"up\": \"y\""), "platform.up: found \"y\"");
    expect(replaced(good, "\"drift_sign\": -1", "\"drift_sign\": 0"), "expected -1 or 1");
    expect(replaced(good, "\"transmission\":", "\"transmission\": \"a lot\", \"x\":"),
           "isolator.transmission");
    expect(replaced(good, "\"step_at_s\": null", "\"step_at_s\": \"soon\""),
           "drift.step_at_s: found \"soon\", expected a number from 0");
    expect(replaced(good, "\"step_after_dwell\": null", "\"step_after_dwell\": 1.5"),
           "drift.step_after_dwell: found 1.5, expected a whole number");
    expect(
        replaced(good, "\"deg\"", "\"grad\""),
        "platform.angle_unit[0]: found \"grad\", expected \"deg\", \"turn\", \"rad\", \"arcmin\", "
        "\"gon\", \"twice\" or \"half\"");
    expect(replaced(good, "\"stuck_gimbal\": null", "\"stuck_gimbal\": \"middle\""),
           "platform.stuck_gimbal: found \"middle\", expected \"outer\", \"inner\" or \"azimuth\"");
    expect(replaced(good, "\"dead\": null", "\"dead\": \"x\""),
           "accelerometer.dead: found \"x\", expected an axis");
    expect(replaced(good, "\"cross_axis\": [", "\"cross_axis\": [0, "), "expected a list of two");
    expect(replaced(good, "\"dead_table\": false", "\"dead_table\": 1"),
           "shaker.dead_table: found 1, expected true or false");
    expect(replaced(good, "\"timeout_register\": null", "\"timeout_register\": -1"),
           "shaker.timeout_register: found -1");
    expect(replaced(good, "\"seed\": 1", "\"seed\": -1"), "seed: found -1");
    expect("", "not JSON");
    // In words of ours, with the place.
    expect("{\n", "truth.json: not JSON, expected a truth file; line 2, column 1: the text ends");
    expect("{\"seed\": 1e999}", "truth.json: not JSON, expected a truth file; a number");
    expect("[1, 2]", "expected an object");
    expect("{}", "coefficients: missing");
    expect(good.substr(0, good.size() / 2), "not JSON");
}

TEST(Truth, AWatchdogThatDoesNotWorkAndAnotherUnitAreLiesOfTheController) {
    const std::string json = to_json(Truth{});
    const auto lies = [&json](const std::string& from, const std::string& to) {
        return parse_truth(replaced(json, from, to), "truth.json").shaker_lies;
    };
    EXPECT_TRUE(lies("\"watchdog_works\": true", "\"watchdog_works\": false").timeout_ignored);
    EXPECT_TRUE(lies("\"g_peak\"", "\"g_rms\"").unit_rms);
    EXPECT_TRUE(lies("\"g_peak\"", "\"mps2_peak\"").unit_mps2);
    EXPECT_FALSE(parse_truth(json, "truth.json").shaker_lies.timeout_ignored);
    EXPECT_EQ(complaint(replaced(json, "\"g_peak\"", "\"g\"")),
              "truth.json: shaker.amplitude_unit: found \"g\", expected \"g_peak\", \"g_rms\" or "
              "\"mps2_peak\"");
}

TEST(Truth, RefusesAnAxisUsedTwice) {
    Truth twice;
    twice.channel[1] = GimbalAxis::outer;
    EXPECT_NE(complaint(to_json(twice)).find("platform.channel: a gimbal is there twice"),
              std::string::npos);
    Truth truth;
    truth.gyro_axes[1][0] = truth.gyro_axes[1][1];
    EXPECT_NE(complaint(to_json(truth)).find("gyro_y_axes"), std::string::npos);
}

}  // namespace
}  // namespace vibrig::plant
