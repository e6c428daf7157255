#include "tests/unit/daemon/configuration/support.hpp"

namespace vibrig::configuration {
namespace {

using ::testing::EndsWith;

struct Mistake {
    const char* text;
    const char* message;
};

class Values : public ::testing::TestWithParam<Mistake> {};

TEST_P(Values, AreRefusedWithWhatWasFoundAndExpected) {
    EXPECT_THAT(complaint(GetParam().text), EndsWith(GetParam().message)) << GetParam().text;
}

INSTANTIATE_TEST_SUITE_P(
    Numbers, Values,
    ::testing::Values(
        Mistake{"vibration.frequency_hz = nan", "found nan, expected a number from 0.1 to 2000 Hz"},
        Mistake{"vibration.frequency_hz = inf", "found inf, expected a number from 0.1 to 2000 Hz"},
        Mistake{"vibration.frequency_hz = -inf",
                "found -inf, expected a number from 0.1 to 2000 Hz"},
        Mistake{"vibration.frequency_hz = 1e300",
                "found 1e+300, expected a number from 0.1 to 2000 Hz"},
        Mistake{"vibration.frequency_hz = true",
                "found true, expected a number from 0.1 to 2000 Hz"},
        Mistake{"vibration.frequency_hz = [15]",
                "found an array of 1, expected a number from 0.1 to 2000 Hz"},
        Mistake{"vibration.frequency_hz = 1979-05-27",
                "found a date or time, expected a number from 0.1 to 2000 Hz"},
        Mistake{"vibration.frequency_hz.hz = 15",
                "found a table, expected a number from 0.1 to 2000 Hz"},
        Mistake{"vibration.level_window_s = 1.9", "found 1.9, expected a number from 2 to 600 s"},
        Mistake{"campaign.settle_s = 1", "found 1, expected a number from 2 to 3600 s"},
        Mistake{"shaker.port = 9223372036854775807",
                "found 9223372036854775807, expected an integer from 1 to 65535"},
        Mistake{"shaker.port = 0", "found 0, expected an integer from 1 to 65535"},
        Mistake{"shaker.registers.run.address = 65536",
                "found 65536, expected an integer from 0 to 65535"},
        Mistake{"platform.drift_sign = 0", "found 0, expected 1 or -1"},
        Mistake{"can.fd = 1", "found 1, expected true or false"}));

INSTANTIATE_TEST_SUITE_P(
    Words, Values,
    ::testing::Values(
        Mistake{"estimator.method = \"two_step\"",
                "found \"two_step\", expected \"joint\" | \"two-step\""},
        Mistake{"clock.source = 3", "found 3, expected \"real\" | \"rig\""},
        Mistake{"platform.up = \"y\"",
                R"(found "y" (a string), expected "+x", "-x", "+y", "-y", "+z" or "-z")"},
        Mistake{"campaign.name = \"../up\"",
                "found \"../up\", expected 1 to 64 letters, digits, ' ', '.', '_' or '-', not "
                "starting with '.'"},
        Mistake{"campaign.name = 7", "found 7, expected a string, 1 to 64 characters"},
        Mistake{"can.interface = \"a_name_far_too_long\"",
                "expected the name of a network interface, 1 to 15 characters, such as \"can0\""},
        Mistake{"can.path = \"run/bus\"",
                "found \"run/bus\", expected an absolute path or \"@name\", 2 to 107 bytes"},
        Mistake{"server.socket = \"\"",
                "found \"\", expected an absolute path, 2 to 107 bytes: its mode says who may open "
                "it"},
        Mistake{
            "server.socket = \"@vibrig\"",
            "found \"@vibrig\", expected an absolute path, 2 to 107 bytes: its mode says who may "
            "open it"},
        Mistake{
            "server.status_socket = \"@status\"",
            "found \"@status\", expected an absolute path, 2 to 107 bytes: its mode says who may "
            "open it"},
        Mistake{"can.signals.outer = \"Outer\"",
                "found \"Outer\", expected \"Message.Signal\", or \"\" for not bound"},
        Mistake{"gimbal.message = \"\"",
                "found \"\", expected a name as in the DBC file: letters, digits and '_'"}));

INSTANTIATE_TEST_SUITE_P(
    Arrays, Values,
    ::testing::Values(
        Mistake{"campaign.table_g = []",
                "found an array of 0, expected an array of 1 to 100 numbers"},
        Mistake{"campaign.table_g = 9", "found 9, expected an array of 1 to 100 numbers"},
        Mistake{"campaign.table_g = [9, nan]",
                "campaign.table_g[1]: found nan, expected a number from 0 to 1000 g"},
        Mistake{"campaign.positions_deg = []",
                "expected an array of 1 to 10000 positions [outer, inner, azimuth]"},
        Mistake{"campaign.positions_deg = [[0, 0, 0], [0, 0]]",
                "campaign.positions_deg[1]: found an array of 2, expected an array of 3 numbers"},
        Mistake{"campaign.positions_deg = [[0, 85, 0]]",
                "campaign.positions_deg[0][1]: found 85, expected a number from -80 to 80 deg"},
        Mistake{"platform.encoder_sign = [1, 2, 1]",
                "platform.encoder_sign[1]: found 2, expected 1 or -1"},
        Mistake{"platform.gyro_x_axes = [\"+x\", \"-x\", \"+z\"]",
                "found \"-x\" a second time, expected input, output and spin along x, y and z in "
                "some order"},
        Mistake{"accelerometer.zero_g = [0, 0]",
                "found an array of 2, expected an array of 3 numbers"},
        Mistake{"accelerometer.matrix = [[1, 0, 0], [0, 1, 0], [0, 0, \"1\"]]",
                "accelerometer.matrix[2][2]: found \"1\" (a string), expected a number from -10 to "
                "10"},
        Mistake{"accelerometer.matrix = [[1, 2, 3], [1, 2, 3], [0, 0, 1]]",
                "found a matrix with determinant 0, expected one that can be inverted (determinant "
                "0.001 at least)"}));

INSTANTIATE_TEST_SUITE_P(
    Tables, Values,
    ::testing::Values(
        Mistake{"site = 3", "site: found 3, expected a table"},
        Mistake{"estimator.prior_sigma = 10", "estimator.prior_sigma: found 10, expected a table"},
        Mistake{
            "estimator.prior_sigma = { bias = -1 }",
            "estimator.prior_sigma.bias: found -1, expected a number from 1e-09 to 1000000 deg/h"},
        Mistake{"shaker.registers.watchdog = 6",
                "found 6, expected a table (the register) or false (none)"},
        Mistake{"[[shaker]]\nport = 1", "shaker: found an array of 1, expected a table"}));

}  // namespace
}  // namespace vibrig::configuration
