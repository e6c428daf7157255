#include <algorithm>
#include <string>
#include <vector>

#include "tests/unit/daemon/configuration/support.hpp"

namespace vibrig::configuration {
namespace {

using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::StartsWith;

std::vector<std::string> lines_of(const std::string& text) {
    std::vector<std::string> lines;
    for (std::size_t begin = 0; begin <= text.size();) {
        const std::size_t end = std::min(text.find('\n', begin), text.size());
        lines.push_back(text.substr(begin, end - begin));
        begin = end + 1;
    }
    return lines;
}

TEST(Errors, NameFileLineColumnKeyFoundAndExpected) {
    EXPECT_EQ(complaint("[site]\nlatitude_deg = 91\n"),
              "rig.toml:2:16: site.latitude_deg: found 91, expected a number from -90 to 90 deg");
}

TEST(Errors, BoundsAreThoseOfTheEstimatorToo) {
    EXPECT_EQ(complaint("[noise]\nresolver_arcsec = 0\n"),
              "rig.toml:2:19: noise.resolver_arcsec: found 0, expected a number from 1e-06 to 3600 "
              "arcsec");
}

TEST(Errors, ComeAllInOneGoInTheOrderOfTheFile) {
    // GIVEN four mistakes, the first of them in a section that the schema has last
    const std::string text =
        "threads.estimator_priority = 100\n"
        "[site]\n"
        "latitude_deg = \"north\"\n"
        "longitude_deg = 26\n"
        "[noise]\n"
        "resolver_bits = 20.5\n";
    // THEN each has its line
    EXPECT_THAT(
        lines_of(complaint(text)),
        ElementsAre(StartsWith("rig.toml:1:30: threads.estimator_priority: found 100, "),
                    StartsWith("rig.toml:3:16: site.latitude_deg: found \"north\" (a string)"),
                    StartsWith("rig.toml:4:1: site.longitude_deg: found an unknown key"),
                    StartsWith("rig.toml:6:17: noise.resolver_bits: found 20.5, expected an "
                               "integer from 8 to 32 bit")));
}

TEST(Errors, RefuseACpuThatNoMachineHas) {
    EXPECT_EQ(complaint("threads.acquisition_cpu = -2"),
              "rig.toml:1:27: threads.acquisition_cpu: found -2, expected an integer from -1 to "
              "1023");
}

TEST(Errors, AnUnknownKeySuggestsTheNearestKnownOne) {
    EXPECT_THAT(complaint("[site]\nlattitude_deg = 45"), EndsWith("perhaps site.latitude_deg"));
    EXPECT_THAT(complaint("[campaign]\nfrequency_hz = 15"),
                EndsWith("perhaps vibration.frequency_hz"));
    EXPECT_THAT(complaint("[vibratoin]\nfrequency_hz = 15"), EndsWith("perhaps vibration"));
    EXPECT_THAT(complaint("shaker.registers.freqency.address = 1"),
                EndsWith("perhaps shaker.registers.frequency"));
    // and none where none is near
    EXPECT_THAT(complaint("[campaign]\nquux = 15"), Not(HasSubstr("perhaps")));
    EXPECT_THAT(complaint("\"\" = 1"), HasSubstr("an unknown key"));
    EXPECT_THAT(complaint("\"a\\nb\\u001b[2J\" = 1"), Not(HasSubstr("\x1b")));
}

TEST(Errors, TooManyPositionsAreRefused) {
    std::string text = "campaign.positions_deg = [";
    for (int i = 0; i < 10'001; ++i) {
        text += "[0,0,0],";
    }
    EXPECT_THAT(complaint(text + "]"), HasSubstr("found an array of 10001, expected"));
}

TEST(Errors, AHundredAreShownAndTheOthersCounted) {
    std::string text;
    for (int i = 0; i < 150; ++i) {
        text += "wrong" + std::to_string(i) + " = 1\n";
    }
    const auto lines = lines_of(complaint(text));
    ASSERT_EQ(lines.size(), 101U);
    EXPECT_EQ(lines.back(), "rig.toml: and 50 more");
}

TEST(Errors, BrokenTomlIsReportedWithLineAndColumn) {
    EXPECT_THAT(complaint("[site]\nlatitude_deg = \n"), StartsWith("rig.toml:2:16: not TOML: "));
    EXPECT_THAT(complaint("[site]\nlatitude_deg = 1\nlatitude_deg = 2\n"),
                StartsWith("rig.toml:3:"));
    EXPECT_THAT(complaint("[site\n"), StartsWith("rig.toml:1:"));
    EXPECT_THAT(complaint(std::string("a = \"\xff\xfe\"")), StartsWith("rig.toml:1:"));
    EXPECT_THAT(complaint(std::string("\0\0\0", 3)), StartsWith("rig.toml:"));
    EXPECT_THAT(complaint("a = " + std::string(100'000, '[')), StartsWith("rig.toml:1:"));
}

}  // namespace
}  // namespace vibrig::configuration
