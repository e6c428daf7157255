#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "tests/unit/support/vibrig_command.hpp"

namespace {

using Json = nlohmann::json;

class ZeroCommand : public vibrig::test::VibrigCommand {
  protected:
    Json json(const std::string& arguments, int code) {
        EXPECT_EQ(vibrig(arguments + " --json"), code) << arguments << ": " << error << out;
        return Json::parse(out, nullptr, false);
    }
};

TEST_F(ZeroCommand, AFileGivesWhatTheSimulatedUnitGave) {
    // GIVEN increments written to a file with the options as they are by default
    ASSERT_EQ(vibrig("zero simulate --zero 3,-2,1 --seed 5 --write run.csv"), 0) << error;
    EXPECT_NE(content("run.csv").find("turn_z_arcsec"), std::string::npos);
    // WHEN they are read back THEN the result is valid: that the unit stands stiller than the
    // bounds of the reference say is no fault
    const Json result = json("zero run.csv --plot zeros.svg", 0);
    EXPECT_TRUE(result["valid"].get<bool>());
    EXPECT_EQ(result["innovation"]["low"], 0);
    EXPECT_GT(result["innovation"]["blocks"], 0);
    // One that moves more than they allow is not.
    EXPECT_EQ(vibrig("zero run.csv --velocity-noise 1e-5 --position-noise 1e-5"), 1);
    EXPECT_NE(out.find("innovations not consistent"), std::string::npos) << out;
    // THEN the zeros are those of the unit
    const std::array<double, 3> truth{3, -2, 1};
    for (std::size_t i = 0; i < 3; ++i) {
        const Json& axis = result["zeros"][i];
        EXPECT_NEAR(axis["zero_mg"], truth[i], 5 * axis["filter_sigma_mg"].get<double>() + 1e-3);
        EXPECT_FALSE(axis["converged_s"].is_null());
    }
    EXPECT_NE(content("zeros.svg").find("<svg"), std::string::npos);
    EXPECT_EQ(vibrig("zero run.csv --azimuth none --inverted"), 1);
    EXPECT_NE(out.find("about 2 g: the unit stands with z up, expected down"), std::string::npos)
        << out;
    expect_refusal("zero run.csv --azimuth heading", "heading");
    expect_refusal("zero none.csv", "none.csv");
}

TEST_F(ZeroCommand, TheHeadingAtAzimuthZeroIsStatedOrSaidToBeAssumed) {
    // GIVEN a unit whose x points 30 deg north of east at azimuth 0
    ASSERT_EQ(vibrig("zero simulate --zero 3,-2,1 --seed 5 --heading 30 --write run.csv"), 0);
    // WHEN that is stated THEN gyro biases and zeros are the unit's
    const Json result = json("zero run.csv --heading 30", 0);
    EXPECT_EQ(result["heading_deg"], 30);
    EXPECT_EQ(result["heading_assumed"], false);
    const std::array<double, 3> truth{3, -2, 1};
    for (std::size_t i = 0; i < 3; ++i) {
        const Json& axis = result["zeros"][i];
        EXPECT_NEAR(axis["zero_mg"], truth[i], 5 * axis["filter_sigma_mg"].get<double>() + 1e-3);
        EXPECT_LT(std::abs(result["gyro_bias_deg_h"][i].get<double>()),
                  4 * result["gyro_sigma_deg_h"][i].get<double>());
    }
    // AND otherwise it is said what was taken
    EXPECT_EQ(json("zero run.csv", 0)["heading_assumed"], true);
    ASSERT_EQ(vibrig("zero run.csv"), 0);
    EXPECT_NE(out.find("assumed: at azimuth 0 the unit's x points true east (--heading)"),
              std::string::npos)
        << out;
    expect_refusal("zero run.csv --heading nan", "--heading: found nan");
}

TEST_F(ZeroCommand, GravityIsStatedOrSaidToBeAssumed) {
    // GIVEN a unit at the equator
    ASSERT_EQ(vibrig("zero simulate --zero 3,-2,1 --seed 5 --gravity 9.78 --write run.csv"), 0);
    // WHEN that is stated THEN the zero of z is the unit's
    const Json stated = json("zero run.csv --gravity 9.78", 0);
    EXPECT_EQ(stated["gravity_mps2"], 9.78);
    EXPECT_EQ(stated["gravity_assumed"], false);
    const double sigma = stated["zeros"][2]["filter_sigma_mg"];
    EXPECT_NEAR(stated["zeros"][2]["zero_mg"], 1, 5 * sigma + 1e-3);
    ASSERT_EQ(vibrig("zero run.csv --gravity 9.78"), 0);
    EXPECT_EQ(out.find("assumed: gravity"), std::string::npos) << out;
    // AND otherwise z has the difference, and it is said what was taken
    const Json assumed = json("zero run.csv", 0);
    EXPECT_EQ(assumed["gravity_mps2"], 9.80665);
    EXPECT_EQ(assumed["gravity_assumed"], true);
    EXPECT_NEAR(assumed["zeros"][2]["zero_mg"], 1 + 1e3 * (9.78 / 9.80665 - 1), 5 * sigma + 1e-2);
    ASSERT_EQ(vibrig("zero run.csv"), 0);
    EXPECT_NE(out.find("assumed: gravity is 9.80665 m/s^2 (--gravity); z is off by 1 mg for each "
                       "0.0098 that it is off"),
              std::string::npos)
        << out;
    // AND what is no tilt is not to be levelled
    EXPECT_EQ(vibrig("zero run.csv --gravity 1"), 1) << out;
    EXPECT_NE(out.find("g, expected 1 g: the unit of velocities or times"), std::string::npos)
        << out;
    EXPECT_EQ(out.find("level first"), std::string::npos) << out;
}

TEST_F(ZeroCommand, TwoFilesZUpAndZDownTellAZeroFromAMisalignment) {
    // GIVEN a unit with x 50 arcsec, y -100 arcsec towards z, z 200 ppm too large, both ways
    const std::string unit = "zero simulate --zero 3,-2,1 --misalignment 50,-100 --scale 0,0,200";
    ASSERT_EQ(vibrig(unit + " --seed 5 --write up.csv"), 0) << error;
    ASSERT_EQ(vibrig(unit + " --seed 6 --inverted --write down.csv"), 0) << error;
    // THEN one way the zeros are as wrong as the misalignment says, and are not said to be more
    EXPECT_EQ(json("zero up.csv", 0)["zeros"][1]["observable"], false);
    // AND both ways they are the unit's, within five sigma
    const Json result = json("zero up.csv --down down.csv", 0);
    const std::array<double, 3> zero{3, -2, 1}, share{50, -100, 200};
    for (std::size_t i = 0; i < 3; ++i) {
        const Json& axis = result["apart"][i];
        const std::string name = i < 2 ? "misalignment_arcsec" : "scale_ppm";
        EXPECT_EQ(axis["observable"], true);
        EXPECT_NEAR(axis["zero_mg"], zero[i], 5 * axis["sigma_mg"].get<double>());
        EXPECT_NEAR(axis[name], share[i], 5 * axis[name + "_sigma"].get<double>());
    }
    // WHEN the second file is z up too THEN it is not valid, and it is said which
    EXPECT_EQ(vibrig("zero up.csv --down up.csv"), 1) << out;
    EXPECT_NE(out.find("not valid: z down: zero of accelerometer z is "), std::string::npos) << out;
    EXPECT_NE(out.find("stands with z up, expected down (the wrong file, or --inverted of `vibrig "
                       "zero` is too much)"),
              std::string::npos)
        << out;
    // with nothing told apart: those numbers would be none of this unit
    EXPECT_NE(out.find("zeros apart from misalignment and scale: none, not every run is valid"),
              std::string::npos)
        << out;
    EXPECT_EQ(out.find(" +- "), std::string::npos) << out;
    const Json wrong = json("zero up.csv --down up.csv", 1);
    EXPECT_EQ(wrong["apart"].size(), 3U);
    for (const Json& axis : wrong["apart"]) {
        EXPECT_EQ(axis["observable"], false);
        const bool z = axis["axis"] == "z";
        for (const std::string key :
             {"zero_mg", "sigma_mg", z ? "scale_ppm" : "misalignment_arcsec",
              z ? "scale_ppm_sigma" : "misalignment_arcsec_sigma"}) {
            ASSERT_TRUE(axis.contains(key)) << key;
            EXPECT_TRUE(axis[key].is_null()) << key;
        }
    }
    EXPECT_EQ(vibrig("zero down.csv"), 1) << out;
    EXPECT_NE(out.find("stands with z down, expected up (the wrong file, or --inverted of `vibrig "
                       "zero` is missing)"),
              std::string::npos)
        << out;
    EXPECT_EQ(out.find("level first"), std::string::npos) << out;
    // AND a folder takes the charts of both
    std::filesystem::create_directory(folder_ / "charts");
    EXPECT_EQ(vibrig("zero up.csv --down down.csv --plot charts"), 0) << error;
    for (const char* const chart : {"charts/zeros-z-up.svg", "charts/zeros-z-down.svg"})
        EXPECT_NE(content(chart).find("<svg"), std::string::npos) << chart;
    expect_refusal("zero up.csv --down down.csv --inverted", "--inverted");
    expect_refusal("zero up.csv --down none.csv", "none.csv");
}

TEST_F(ZeroCommand, SimulatesAndExplains) {
    const Json result = json("zero simulate --scale 0,0,100 --both-ways", 0);
    EXPECT_TRUE(result["valid"].get<bool>());
    EXPECT_EQ(result["observability"]["rank"], 15);
    EXPECT_EQ(result["zeros"][2]["what"], "zero + 1 g x scale error");
    EXPECT_GT(result["zeros"][2]["sigma_mg"], 0.1);
    EXPECT_NEAR(result["zeros"][0]["level_arcmin"], 5 * 3.438, 0.2);
    EXPECT_EQ(result["zeros"][0]["what"], "zero + 1 g x misalignment");
    EXPECT_NEAR(result["zeros"][0]["sigma_mg"], 0.242, 0.003);  // 50 arcsec
    EXPECT_EQ(result["zeros"][0]["observable"], false);
    EXPECT_EQ(result["apart"][0]["observable"], true);
    EXPECT_NEAR(result["apart"][2]["scale_ppm"], 100, 10);
    EXPECT_NEAR(result["apart"][2]["zero_mg"], 5, 0.01);
    EXPECT_NEAR(result["apart"][0]["zero_mg"], 5, 5 * result["apart"][0]["sigma_mg"].get<double>());
    EXPECT_EQ(vibrig("zero simulate"), 0) << error;
    EXPECT_NE(out.find("rank 15 of 15"), std::string::npos) << out;
    EXPECT_EQ(vibrig("zero simulate --vibration 1"), 1);
    EXPECT_NE(out.find("shaker must be off"), std::string::npos);
    EXPECT_EQ(vibrig("zero simulate --duration 30"), 1);
    EXPECT_NE(out.find("has not converged"), std::string::npos);
    EXPECT_EQ(vibrig("zero simulate --slews 0 --static --duration 80"), 1);
}

TEST_F(ZeroCommand, RefusesBadInput) {
    expect_refusal("zero", "FILE or `simulate` expected");
    expect_refusal("zero simulate --slews 0", "rank 12 of 15");
    expect_refusal("zero simulate --slews 0,360", "phi_E with nab_y");
    expect_refusal("zero simulate --rate 0.00139 --duration 30", "smallest singular value");
    expect_refusal("zero simulate --rate=-5", "--rate: found -5, expected a finite number above 0");
    expect_refusal("zero simulate --rate 1e9", "--rate: found 1e9");
    expect_refusal("zero simulate --latitude 90", "latitude");
    expect_refusal("zero simulate --duration 86400 --period 0.0001", "expected at most 1e7");
    expect_refusal("zero simulate --write no/such/run.csv --duration 80", "no/such/run.csv");
    expect_refusal("zero simulate --vibration-limit=-1", "--vibration-limit: found -1");
    // What is no number passes no option, and the line names it.
    for (const char* option :
         {"--latitude", "--gravity", "--slews", "--rate", "--duration", "--gyro-noise",
          "--accelerometer-noise", "--velocity-noise", "--position-noise", "--scale-uncertainty",
          "--vibration-limit", "--period", "--vibration"}) {
        for (const char* value : {"nan", "inf", "-inf"}) {
            expect_refusal(std::string("zero simulate ") + option + "=" + value,
                           std::string(option) + ": found " + value + ", expected a finite number");
        }
    }
    for (const char* option : {"--lever-arm", "--zero", "--scale"}) {
        expect_refusal(std::string("zero simulate ") + option + "=1,nan,1",
                       std::string(option) + ": found nan, expected a finite number");
    }
}

TEST_F(ZeroCommand, RefusesAFileThatIsNoneWithItsLine) {
    const std::string header =
        "time_s,turn_x_arcsec,turn_y_arcsec,turn_z_arcsec,dv_x_mps,dv_y_mps,dv_z_mps,azimuth_deg\n";
    const auto rows = [&](const std::vector<std::string>& times) {
        std::string text = "# a comment\n" + header;
        for (const std::string& time : times) text += time + ",0,0,0,0,0,0.098,0\n";
        return text;
    };
    write("header.csv", header);
    write("nan.csv", rows({"0", "0.01", "nan"}));
    write("none.csv", rows({"", "0.01"}));
    write("twice.csv", rows({"0", "0.01", "0.01", "0.02"}));
    write("back.csv", rows({"0", "0.02", "0.01"}));
    write("far.csv", rows({"1e300", "2e300"}));
    write("days.csv", rows({"0", "0.01", "1e6"}));
    write("short.csv", rows({"0", "0.01", "0.02"}));
    write("turn.csv", header + "0,0,0,0,0,0,0,0\n0.01,0,1e300,0,0,0,0,0\n");
    write("gaps.csv", header +
                          "0,0,0,0,0,0,0,0\n0.01,,0,0,0,0,0,0\n0.02,,0,0,0,0,0,0\n"
                          "0.03,,0,0,0,0,0,0\n0.04,,0,0,0,0,0,0\n");
    expect_refusal("zero header.csv", "header.csv: found no row after the header");
    expect_refusal("zero nan.csv", "nan.csv:5: column time_s: found no number, expected s from");
    expect_refusal("zero none.csv", "none.csv:3: column time_s: found no number");
    expect_refusal("zero twice.csv",
                   "twice.csv:5: column time_s: found 0.01, expected more than 0.01 of the row");
    expect_refusal("zero back.csv",
                   "back.csv:5: column time_s: found 0.01, expected more than 0.02 of the row");
    expect_refusal("zero far.csv",
                   "far.csv:3: column time_s: found 1e+300, expected s from -1e+12 to 1e+12");
    expect_refusal("zero days.csv", "days.csv:5: column time_s: found 1000000, expected at most");
    expect_refusal("zero short.csv", "short.csv: found increments of 0.02 s, expected 1 s or more");
    expect_refusal("zero turn.csv", "turn.csv:3: column turn_y_arcsec: found 1e+300");
    expect_refusal("zero gaps.csv", "gaps.csv: given up: more than 3 gaps");
    EXPECT_EQ(out, "") << "zeros that nobody found";
}

TEST_F(ZeroCommand, NoOptionIsTakenAndLeftAside) {
    expect_refusal("zero z.csv simulate", "zero: found z.csv with `simulate`");
    expect_refusal("zero --down z.csv simulate", "--down: found it with `simulate`");
    expect_refusal("zero --azimuth none simulate", "--azimuth: found it with `simulate`");
    for (const char* option : {"--json", "--plot x.svg", "--both-ways", "--second-axis"}) {
        const std::string asked = option;
        expect_refusal("zero simulate --write run.csv " + asked,
                       asked.substr(0, asked.find(' ')) + ": found it with --write");
    }
    EXPECT_FALSE(std::filesystem::exists(folder_ / "run.csv"));
    expect_refusal("zero simulate --both-ways --inverted", "--both-ways: found it with --inverted");
}

TEST_F(ZeroCommand, ReproducesTheTable) {
    const Json result = json("reproduce accelerometer --seeds 2", 0)["reproductions"][0];
    EXPECT_TRUE(result["agrees"].get<bool>()) << out;
    EXPECT_GT(result["rows"].size(), 12U);
}

TEST_F(ZeroCommand, ASecondAxisBothWaysTellsZerosFromMisalignmentAsZDownDoes) {
    const std::string unit = "zero simulate --zero 3,-2,1 --misalignment 100,-50 --scale 0,0,200 ";
    const auto expect_pure = [](const Json& result) {
        const std::array<double, 3> zero{3, -2, 1}, share{100, -50, 200};
        for (std::size_t i = 0; i < 3; ++i) {
            const Json& axis = result["apart"][i];
            const double sigma = axis["sigma_mg"];
            EXPECT_LT(sigma, 0.01);
            EXPECT_NEAR(axis["zero_mg"], zero[i], 5 * sigma);
            const std::string name = i == 2 ? "scale_ppm" : "misalignment_arcsec";
            EXPECT_NEAR(axis[name], share[i], 5 * axis[name + "_sigma"].get<double>());
        }
        const Json& x = result["apart"][0];
        EXPECT_NEAR(x["misalignment_to_y_arcsec"], 0,
                    5 * x["misalignment_to_y_arcsec_sigma"].get<double>());
    };
    expect_pure(json(unit + "--second-axis", 0));
    EXPECT_EQ(vibrig(unit + "--second-axis"), 0);
    EXPECT_NE(out.find("towards y"), std::string::npos) << out;
    // AND so do three files
    ASSERT_EQ(vibrig(unit + "--write up.csv"), 0) << error;
    ASSERT_EQ(vibrig(unit + "--upright y --seed 2 --write y_up.csv"), 0) << error;
    ASSERT_EQ(vibrig(unit + "--upright y --seed 3 --inverted --write y_down.csv"), 0) << error;
    expect_pure(json("zero up.csv --y-up y_up.csv --y-down y_down.csv", 0));
    expect_refusal("zero simulate --upright x", "--upright");
    expect_refusal("zero up.csv --y-up none.csv", "none.csv");
}

}  // namespace
