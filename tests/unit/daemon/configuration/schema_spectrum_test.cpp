#include <cmath>
#include <fstream>
#include <string>
#include <vector>

#include "tests/unit/daemon/configuration/spectrum_keys.hpp"
#include "tests/unit/daemon/configuration/support.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::configuration {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

TEST(SpectrumKeys, AProfileIsTakenWithItsTable) {
    const auto c = accepted(
        profile_with("number = 3\npsd = [[10, 0.015], [40, 0.015], [500, 0.00015]]\ng_rms = 1.04\n"
                     "direction = [0, 2, 0]\nat = \"table\"\n"));
    ASSERT_EQ(c.profiles.size(), 1U);
    EXPECT_EQ(c.profiles[0].profile.psd.size(), 3U);
    EXPECT_EQ(c.profiles[0].profile.direction[1], 1);
    EXPECT_TRUE(c.profiles[0].at_table);
}

TEST(SpectrumKeys, EachBadProfileIsReportedWithPlaceValueAndWhatWasExpected) {
    const auto said = [](const std::string& lines) {
        return complaint(profile_with(lines), false);
    };
    EXPECT_THAT(said("psd = [[20, 0.01], [10, 0.01]]\n"),
                AllOf(StartsWith("rig.toml:3:"), HasSubstr("profile[0].psd[1]"),
                      HasSubstr("found 10 Hz after 20 Hz, expected growing frequencies")));
    EXPECT_THAT(said("psd = [[20, 0.01], [30, 0]]\n"),
                HasSubstr("profile[0].psd[1]: found 0 g^2/Hz, expected a density above 0"));
    EXPECT_THAT(said("psd = [[20, -0.01], [30, 0.01]]\n"),
                HasSubstr("profile[0].psd[0]: found -0.01 g^2/Hz, expected a density above 0"));
    EXPECT_THAT(said("psd = [[20, 0.04], [120, 0.04]]\ng_rms = 3\n"),
                AllOf(StartsWith("rig.toml:4:"),
                      HasSubstr("profile[0].g_rms: found 3, expected that of the table within 1 "
                                "%: 2")));
    EXPECT_EQ(said("psd = [[20, 0.04], [120, 0.04]]\ng_rms = 2.015\n"), "");
    EXPECT_THAT(said("psd = [[20, 0.04]]\n"), HasSubstr("profile[0].psd"));
    EXPECT_THAT(said("psd = [[20, 0.04], [30]]\n"), HasSubstr("profile[0].psd[1]"));
    EXPECT_THAT(said(""), HasSubstr("found neither psd nor file, expected one of them"));
    EXPECT_THAT(said("psd = [[20, 0.04], [30, 0.04]]\nat = \"roof\"\n"),
                HasSubstr("expected \"platform\" or \"table\""));
    EXPECT_THAT(said("psd = [[20, 0.04], [30, 0.04]]\ncolour = 1\n"),
                HasSubstr("profile[0].colour: found an unknown key"));
    EXPECT_THAT(said("file = \"nowhere.json\"\n"), HasSubstr("nowhere.json"));
    const std::string one = profile_with("psd = [[20, 0.04], [30, 0.04]]\n");
    EXPECT_THAT(complaint(one + one, false), HasSubstr("profile[1].name"));
    EXPECT_THAT(complaint(one + "number = 4\n[[profile]]\nname = \"q\"\nnumber = 4\n" +
                              "psd = [[20, 0.04], [30, 0.04]]\n",
                          false),
                HasSubstr("profile[1].number: found 4 a second time"));
}

TEST(SpectrumKeys, AProfilesFileIsHeldToTheSame) {
    const TemporaryFolder folder;
    const std::string path = folder.file("profile.json");
    const auto said = [&](const std::string& content) {
        std::ofstream(path) << content;
        return complaint(profile_with("file = \"" + path + "\"\n"), false);
    };
    EXPECT_EQ(said(R"({"psd":[[20,0.01],[120,0.01]]})"), "");
    EXPECT_THAT(
        said(R"({"psd":[[20,0.01],[10,0.01]]})"),
        AllOf(StartsWith("rig.toml:"), HasSubstr("profile.json: psd[1]: found 10 Hz after")));
    EXPECT_THAT(said(R"({"psd":[[20,0.01],[30,0]]})"),
                HasSubstr("psd[1]: found 0 g^2/Hz, expected a density above 0"));
    EXPECT_THAT(said(R"({"psd":[[20,0.04],[120,0.04]],"g_rms":3})"), HasSubstr("g_rms: found 3"));
}

/// Of two words one would be left aside, and the drift predicted for the other.
TEST(SpectrumKeys, AProfileAndItsFileSayTheSame) {
    const TemporaryFolder folder;
    const std::string path = folder.file("profile.json");
    const auto with = [&](const std::string& of_file, const std::string& keys) {
        std::ofstream(path) << R"({"psd":[[20,0.01],[120,0.01]])" << of_file << "}";
        return profile_with("file = \"" + path + "\"\n" + keys);
    };
    const std::string platform = R"(,"at":"platform")", north = R"(,"direction":[2,0,0])";
    EXPECT_THAT(complaint(with(platform, "at = \"table\"\n"), false),
                HasSubstr("profile (p).at: found table, expected that of " + path + ", platform"));
    EXPECT_THAT(complaint(with("", "direction = [1, 0, 0]\n"), false),
                HasSubstr("profile (p).direction: found [1.0, 0.0, 0.0], expected that of " + path +
                          ", [0.0, 1.0, 0.0]"));
    EXPECT_THAT(complaint(with(north, "direction = [0, 1, 0]\n"), false),
                HasSubstr("profile (p).direction: found [0.0, 1.0, 0.0]"));
    EXPECT_EQ(
        complaint(with(platform + north, "at = \"platform\"\ndirection = [1, 0, 0]\n"), false), "");
    // What the file leaves open the configuration says.
    EXPECT_TRUE(accepted(with("", "at = \"table\"\n")).profiles.at(0).at_table);
}

TEST(SpectrumKeys, AHardMountHasATransmissionOfOne) {
    EXPECT_EQ(accepted("spectrum.mount = \"hard\"\n").estimator.transmission, 1);
    // Nor does the platform lag; what is stated stands.
    EXPECT_EQ(accepted("spectrum.mount = \"hard\"\n").campaign.loop.phase_deg, 0);
    EXPECT_EQ(
        accepted("spectrum.mount = \"hard\"\nselftest.phase_deg = 90\n").campaign.loop.phase_deg,
        90);
    EXPECT_THAT(complaint("vibration.transmission = 0.6667\nspectrum.mount = \"hard\"\n", false),
                HasSubstr("found 0.6667 with a hard mount, expected 1"));
    const auto c = accepted("spectrum.transmission = [[10, 0.9], [40, 0.15]]\n");
    EXPECT_NEAR(c.spectrum.mount.transmission(40).value(), 0.15, 1e-12);
    EXPECT_THAT(complaint("spectrum.transmission = [[40, 0.9], [10, 0.15]]\n", false),
                HasSubstr("found 10 Hz after 40 Hz, expected growing frequencies"));
    EXPECT_THAT(complaint("spectrum.transmission = \"felt\"\n", false), HasSubstr("\"pads\""));
    // AND it is another rig than the one that was proved
    EXPECT_NE(
        accepted("vibration.transmission = 1\n").campaign.proof.keys,
        accepted("vibration.transmission = 1\nspectrum.mount = \"hard\"\n").campaign.proof.keys);
}

TEST(SpectrumKeys, AProofCoversTheFrequenciesOfThePlan) {
    const TemporaryFolder folder;
    const auto keys_with = [&](const std::vector<double>& hz) {
        const std::string path = folder.file("plan.json");
        std::string runs;
        for (const double one : hz)
            runs += (runs.empty() ? "" : ",") +
                    (R"({"position":[0,0,0],"table_g":3,"frequency_hz":)" + std::to_string(one)) +
                    "}";
        std::ofstream(path) << R"({"runs":[)" << runs << "]}";
        return accepted("spectrum.mount = \"hard\"\ncampaign.plan = \"" + path + "\"\n")
            .campaign.proof.keys;
    };
    EXPECT_THAT(keys_with({15, 65.1, 25.1, 65.1}),
                HasSubstr("frequencies of campaign.plan=25.1, 65.1 Hz\n"));
    EXPECT_THAT(keys_with({15, 15}), Not(HasSubstr("frequencies of")));
}

TEST(AccelerometerKeys, AResponseIsTakenAsItIsStated) {
    const auto c = accepted("[accelerometer]\nbandwidth_hz = 100\norder = 2\nskew_ms = 0.1\n");
    const auto& response = c.estimator.accelerometer_response;
    EXPECT_NEAR(response.power(60), 1 / (1 + std::pow(0.6, 4)), 1e-12);
    EXPECT_NEAR(response.skew_error(60), 3.55e-4, 1e-5);
    EXPECT_TRUE(accepted("").estimator.accelerometer_response.flat());
    const auto table = accepted("accelerometer.response = [[10, 1], [40, 0.9], [200, 0.3]]\n");
    EXPECT_NEAR(table.estimator.accelerometer_response.power(40), 0.81, 1e-12);
    const std::string shown = format_effective(
        parse("accelerometer.response = [[10, 1], [40, 0.9]]\n", "rig.toml", false));
    EXPECT_THAT(shown, HasSubstr("accelerometer.response"));
    EXPECT_THAT(shown, HasSubstr("[10.0, 1.0], [40.0, 0.9]"));
    EXPECT_THAT(shown, HasSubstr("accelerometer.bandwidth_hz"));
    EXPECT_THAT(shown, HasSubstr("accelerometer.skew_ms"));
}

TEST(AccelerometerKeys, BadOnesAreReportedWithPlaceValueAndWhatWasExpected) {
    const auto said = [](const std::string& lines) {
        return complaint("[accelerometer]\n" + lines, false);
    };
    EXPECT_THAT(
        said("bandwidth_hz = -1\n"),
        AllOf(StartsWith("rig.toml:2:"), HasSubstr("accelerometer.bandwidth_hz: found -1")));
    EXPECT_THAT(said("order = 0\n"), HasSubstr("found 0, expected an integer from 1 to 8"));
    EXPECT_THAT(said("order = 2\n"),
                HasSubstr("found 2 without a bandwidth, expected accelerometer.bandwidth_hz"));
    EXPECT_THAT(said("skew_ms = 1000\n"), HasSubstr("accelerometer.skew_ms: found 1000"));
    EXPECT_THAT(said("response = [[40, 1], [10, 0.5]]\n"),
                HasSubstr("found 10 Hz after 40 Hz, expected growing frequencies"));
    EXPECT_THAT(said("response = [[40, 0], [100, 0.5]]\n"),
                HasSubstr("accelerometer.response[0][1]: found 0"));
    EXPECT_THAT(said("response = 3\n"), HasSubstr("[[hz, ratio], ..]"));
    EXPECT_THAT(said("bandwidth_hz = 100\nresponse = [[10, 1], [40, 0.9]]\n"),
                HasSubstr("found a table beside accelerometer.bandwidth_hz, expected one of them"));
    EXPECT_THAT(said("bandwidth_hz = 100\n[estimator]\nmethod = \"two-step\"\n"),
                HasSubstr("expected estimator.method = \"joint\""));
}

}  // namespace
}  // namespace vibrig::configuration
