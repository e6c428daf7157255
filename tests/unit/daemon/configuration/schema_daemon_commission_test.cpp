// Bad values of the keys of commissioning: each with place, what was found and what was expected.
#include "tests/unit/daemon/configuration/support.hpp"

namespace vibrig::configuration {
namespace {

struct Wrong {
    const char* text;     ///< of rig.toml
    const char* message;  ///< behind "rig.toml:"
};

class CommissioningKeys : public ::testing::TestWithParam<Wrong> {};

TEST_P(CommissioningKeys, ABadValueIsNamedByLineColumnFoundAndExpected) {
    const std::string text = std::string(GetParam().text) + "\n";
    EXPECT_EQ(complaint(text, false), std::string("rig.toml:") + GetParam().message);
}

INSTANTIATE_TEST_SUITE_P(
    All, CommissioningKeys,
    ::testing::Values(
        Wrong{"[commission]\nfolder = 7",
              "2:10: commission.folder: found 7, expected a string, a path"},
        Wrong{"[commission]\nfolder = \"\"",
              "2:10: commission.folder: found \"\", expected a path, not empty"},
        Wrong{"[commission]\nsimulated = \"yes\"",
              "2:13: commission.simulated: found \"yes\" (a string), expected true or false"},
        Wrong{"[commission]\nenforce = 1",
              "2:11: commission.enforce: found 1, expected true or false"},
        Wrong{"[commission]\nvalid_days = 0",
              "2:14: commission.valid_days: found 0, expected a number from 1 to 3660 d"},
        Wrong{"[commission]\nvalid_days = \"year\"",
              "2:14: commission.valid_days: found \"year\" (a string), expected a number from 1 to "
              "3660 d"},
        Wrong{"[commission]\nvalid_days = nan",
              "2:14: commission.valid_days: found nan, expected a number from 1 to 3660 d"},
        Wrong{"[commission]\nlinear_sigma = 0",
              "2:16: commission.linear_sigma: found 0, expected a number from 0.01 to 100 deg/h/g"},
        Wrong{"[commission]\nlinear_sigma = inf",
              "2:16: commission.linear_sigma: found inf, expected a number from 0.01 to 100 "
              "deg/h/g"},
        Wrong{"[commission]\nopening_check = \"no\"",
              "2:17: commission.opening_check: found \"no\" (a string), expected true or false"},
        Wrong{"[commission]\nbuttons = []",
              "2:11: commission.buttons: found an array of 0, expected an array of 1 to 16 names"},
        Wrong{"[commission]\nbuttons = \"rack\"",
              "2:11: commission.buttons: found \"rack\" (a string), expected an array of 1 to 16 "
              "names"},
        Wrong{"[commission]\nbuttons = [\"rack\", \"rack\"]",
              "2:20: commission.buttons[1]: found \"rack\" (a string), expected a name of 1 to 40 "
              "printable characters, each once"},
        Wrong{"[commission]\nbuttons = [\"rack\", \"\"]",
              "2:20: commission.buttons[1]: found \"\" (a string), expected a name of 1 to 40 "
              "printable characters, each once"},
        Wrong{"[commission]\nbuttons = [\"rack\", 7]",
              "2:20: commission.buttons[1]: found 7, expected a name of 1 to 40 printable "
              "characters, each once"},
        Wrong{"[commission]\nstop_s = 0",
              "2:10: commission.stop_s: found 0, expected a number from 0.1 to 2 s"},
        Wrong{"[commission]\nstop_s = 2.5",
              "2:10: commission.stop_s: found 2.5, expected a number from 0.1 to 2 s"},
        Wrong{"[commission]\nbutton = [\"rack\"]",
              "2:1: commission.button: found an unknown key, expected a known one, perhaps "
              "commission.buttons"},
        Wrong{"[commission]\ncertificate = 7",
              "2:15: commission.certificate: found 7, expected an array of 0 to 30 tables { name = "
              "\"D_Fx\", value = 1.2 }"},
        Wrong{"[commission]\ncertificate = [{ name = \"D_Fw\", value = 1 }]",
              "2:25: commission.certificate[0].name: found \"D_Fw\" (a string), expected a "
              "coefficient, D_Fx to D_OSz, each once"},
        Wrong{"[commission]\ncertificate = [{ name = \"D_Fx\", value = \"1\" }]",
              "2:41: commission.certificate[0].value: found \"1\" (a string), expected a number "
              "from -1000 to 1000"},
        Wrong{"[gimbal]\ntravel_deg = 130",
              "2:14: gimbal.travel_deg: found 130, expected an array of 3 ranges [lowest, highest] "
              "of outer, inner, azimuth"},
        Wrong{
            "[gimbal]\ntravel_deg = [[-130, 130], [-30, 30]]",
            "2:14: gimbal.travel_deg: found an array of 2, expected an array of 3 ranges [lowest, "
            "highest] of outer, inner, azimuth"},
        Wrong{"[gimbal]\ntravel_deg = [[130, -130], [-30, 30], [-175, 175]]",
              "2:15: gimbal.travel_deg[0]: found [130, -130], expected the lowest angle below the "
              "highest"},
        Wrong{"[gimbal]\ntravel_deg = [[-130, 130], [-30, \"x\"], [-175, 175]]",
              "2:34: gimbal.travel_deg[1][1]: found \"x\" (a string), expected a number from -360 "
              "to 360 deg"},
        Wrong{
            "[gimbal]\ntravel_deg = [[-130, 130], [-30, 30], [-1e9, 175]]",
            "2:40: gimbal.travel_deg[2][0]: found -1e+09, expected a number from -360 to 360 deg"},
        Wrong{"[site]\nelevation_deg = 2.5",
              "2:17: site.elevation_deg: found 2.5, expected a number from -2 to 2 deg"},
        Wrong{"[site]\nelevation_deg = \"flat\"",
              "2:17: site.elevation_deg: found \"flat\" (a string), expected a number from -2 to 2 "
              "deg"},
        Wrong{"[site]\nelevation_deg = nan",
              "2:17: site.elevation_deg: found nan, expected a number from -2 to 2 deg"}));

TEST(Certificate, IsReadAndPrinted) {
    const std::string text =
        "[commission]\ncertificate = [{ name = \"D_Fx\", value = 1.2 }, { value = -3, name = "
        "\"D_OSz\" }]\n";
    const auto loaded = parse(text, "rig.toml", false);
    ASSERT_EQ(loaded.configuration.commission.certificate.size(), 2U);
    EXPECT_EQ(loaded.configuration.commission.certificate[1].value, -3);
    for (const auto& value : loaded.effective)
        if (value.key == "commission.certificate") {
            EXPECT_EQ(value.value,
                      "[{ name = \"D_Fx\", value = 1.2 }, { name = \"D_OSz\", value = -3.0 }]");
        }
    EXPECT_EQ(complaint("[commission]\ncertificate = []\n"), "");
}

}  // namespace
}  // namespace vibrig::configuration
