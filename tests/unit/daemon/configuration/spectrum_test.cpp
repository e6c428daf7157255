#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "tests/unit/daemon/configuration/support.hpp"
#include "tests/unit/plant/temporary_folder.hpp"

namespace vibrig::configuration {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

std::string profile_with(const std::string& lines) { return "[[profile]]\nname = \"p\"\n" + lines; }

TEST(SpectrumKeys, AProfileIsTakenWithItsTable) {
    const auto c = accepted(
        profile_with("number = 3\npsd = [[10, 0.015], [40, 0.015], [500, 0.00015]]\ng_rms = 1.04\n"
                     "direction = [0, 2, 0]\nat = \"table\"\n"));
    ASSERT_EQ(c.profiles.size(), 1U);
    EXPECT_EQ(c.profiles[0].profile.psd.size(), 3U);
    EXPECT_EQ(c.profiles[0].profile.direction[1], 1);
    EXPECT_TRUE(c.profiles[0].at_table);
}

TEST(SpectrumKeys, EachBadProfileIsToldWithPlaceValueAndWhatWasExpected) {
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
    const plant::TemporaryFolder folder;
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

TEST(SpectrumKeys, AProfileBeyondTheShakerOrTheAccelerometersIsRefusedByTheDaemon) {
    // The truck type at a hard mount: 3 sigma are 3.1 g, 0.17 m/s and 1.66 mm.
    const std::string truck =
        "psd = [[10, 0.015], [40, 0.015], [500, 0.00015]]\n[spectrum]\nmount = \"hard\"\n";
    const auto said = [&](const std::string& more) {
        return complaint(profile_with(truck) + more, true);
    };
    EXPECT_EQ(said(""), "");
    EXPECT_THAT(said("[shaker.limits]\nacceleration_g = 3\n"),
                AllOf(HasSubstr("profile[0] (p): found peaks of 3 sigma of 3.128"),
                      HasSubstr("shaker.limits.acceleration_g")));
    EXPECT_THAT(said("[shaker.limits]\nvelocity_mps = 0.1\n"), HasSubstr("3 sigma of 0.166"));
    EXPECT_THAT(said("[shaker.limits]\ndisplacement_mm = 1\n"), HasSubstr("3 sigma of 1.6"));
    // 1 + 5 * 1.0429 g
    EXPECT_THAT(said("[accelerometer]\nrange_g = 6\n"),
                AllOf(HasSubstr("5 sigma of 6.21"), HasSubstr("accelerometer.range_g")));
    EXPECT_EQ(said("[accelerometer]\nrange_g = 6.3\n"), "");
    // Minimum integrity: 23 g, 6 dB too much.
    EXPECT_THAT(complaint(profile_with("psd = [[20, 0.04], [1000, 0.04], [2000, 0.01]]\n"
                                       "[spectrum]\nmount = \"hard\"\n"),
                          true),
                AllOf(HasSubstr("3 sigma of 23.0"), HasSubstr("-5.6")));
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
    const plant::TemporaryFolder folder;
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

TEST(SpectrumKeys, FrequenciesThatSamplingForbidsAreRefusedWithTheNearestFreeOne) {
    EXPECT_THAT(complaint("vibration.frequency_hz = 60\n", true),
                AllOf(HasSubstr("found 60 Hz"), HasSubstr("nearest free one is 60.2 Hz")));
    const plant::TemporaryFolder folder;
    const auto plan_at = [&](const std::string& hz) {
        const std::string path = folder.file("plan.json");
        std::ofstream(path) << R"({"runs":[{"position":[0,0,0],"table_g":3,"frequency_hz":)" << hz
                            << "}]}";
        return complaint("campaign.plan = \"" + path + "\"\n", true);
    };
    EXPECT_THAT(plan_at("60"), AllOf(StartsWith("rig.toml:1:"), HasSubstr("found dwell 1 at 60 Hz"),
                                     HasSubstr("the nearest free one is 60.2 Hz")));
    EXPECT_THAT(plan_at("10.7"), HasSubstr("below it the isolators amplify"));
    EXPECT_THAT(plan_at("35.1"), HasSubstr("no dwell to identify at 15 Hz within 2 %"));
    EXPECT_EQ(plan_at("15"), "");
    EXPECT_THAT(complaint("spectrum.mode = \"mixed\"\n", true),
                HasSubstr("found \"mixed\" without registers of mode and profile"));
}

const std::string kRandomRegisters = R"([shaker.registers]
mode = { address = 8 }
profile_number = { address = 9 }
profile_level_db = { address = 10 }
profile_checksum = { address = 5 }
measured_g_rms = { address = 7 }
control_state = { address = 9 }
)";

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

TEST(AccelerometerKeys, BadOnesAreToldWithPlaceValueAndWhatWasExpected) {
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

/// Below half of a line's power, and where the table does not reach.
TEST(AccelerometerKeys, WhatTheyHardlySeeIsRefused) {
    EXPECT_THAT(complaint("accelerometer.bandwidth_hz = 14\n", false),
                AllOf(HasSubstr("accelerometer.bandwidth_hz: found 15 Hz, of which the "
                                "accelerometers see 0.465"),
                      HasSubstr("half of the power at least")));
    EXPECT_EQ(complaint("accelerometer.bandwidth_hz = 15\n", false), "");
    const plant::TemporaryFolder folder;
    const auto plan_with = [&](const std::string& run, const std::string& more) {
        const std::string path = folder.file("plan.json");
        std::ofstream(path) << R"({"runs":[{"position":[0,0,0],"table_g":3},{"position":[0,0,0],)"
                            << run << "}]}";
        return "spectrum.mount = \"hard\"\ncampaign.plan = \"" + path + "\"\n" + more;
    };
    const auto said = [&](const std::string& run, const std::string& more) {
        return complaint(plan_with(run, more), true);
    };
    const std::string high = R"("table_g":3,"frequency_hz":125.1)";
    EXPECT_THAT(said(high, "accelerometer.bandwidth_hz = 100\n"),
                AllOf(HasSubstr("found dwell 2 at 125.1 Hz"),
                      HasSubstr("of which the accelerometers see 0.389")));
    EXPECT_THAT(said(high, "accelerometer.response = [[10, 1], [100, 0.9]]\n"),
                HasSubstr("of which the accelerometers see 0"));
    EXPECT_EQ(said(high, "accelerometer.bandwidth_hz = 130\n"), "");
    // What the witnesses expect is what the accelerometers show.
    const auto c = accepted(plan_with(high, "accelerometer.bandwidth_hz = 130\n"), true);
    const double power = 1 / (1 + std::pow(125.1 / 130, 2));
    EXPECT_NEAR(c.campaign.stops[1].transmission, std::sqrt(power), 1e-12);
    EXPECT_NEAR(c.campaign.stops[0].transmission, 1 / std::sqrt(1 + std::pow(15.0 / 130, 2)),
                1e-12);
    // 20 to 120 Hz: 100 (atan 1.2 - atan 0.2) / 100 of it with 100 Hz, 0.68.
    const std::string random = R"("profile":"p")";
    const auto with = [&](const std::string& hz) {
        return "spectrum.mode = \"mixed\"\naccelerometer.bandwidth_hz = " + hz + "\n" +
               kRandomRegisters +
               profile_with("number = 4\nat = \"table\"\npsd = [[20, 0.02], [120, 0.02]]\n");
    };
    EXPECT_THAT(said(random, with("40")),
                AllOf(HasSubstr("profile[0] (p): found a vibration of which the accelerometers "
                                "see 0.3"),
                      HasSubstr("half of its power at least")));
    const auto r = accepted(plan_with(random, with("100")), true);
    const double share = std::atan(1.2) - std::atan(0.2);
    ASSERT_EQ(r.estimator.seen_profiles.size(), 1U);
    EXPECT_EQ(r.estimator.seen_profiles[0].first, 4);
    EXPECT_NEAR(r.estimator.seen_profiles[0].second.share, share, 1e-4);
    EXPECT_NEAR(r.campaign.stops[1].transmission, std::sqrt(share), 1e-4);
}

TEST(RandomRegisters, AreNoneUnlessStatedAndThenAsStated) {
    EXPECT_FALSE(accepted("", true).shaker.registers.random);
    const auto map = accepted("spectrum.mode = \"mixed\"\n" + kRandomRegisters, true)
                         .shaker.registers.random.value();
    EXPECT_EQ(map.profile_level_db.type, proto::RegisterType::i16);
    EXPECT_EQ(map.profile_level_db.scale, 0.1);
    EXPECT_EQ(map.control_state.table, proto::RegisterTable::input);
    const auto shown = [](const std::string& text) {
        return format_effective(parse(as_simulated(text, true), "rig.toml", true));
    };
    EXPECT_THAT(shown(kRandomRegisters), HasSubstr("shaker.registers.profile_checksum.address"));
    EXPECT_THAT(shown(""), Not(HasSubstr("profile_checksum")));
}

TEST(RandomRegisters, EachMissingOrUnfitRoleIsNamed) {
    const auto without = [](const std::string& role) {
        std::string text = kRandomRegisters;
        const auto at = text.find(role);
        return complaint(text.erase(at, text.find('\n', at) + 1 - at), true);
    };
    for (const char* role : {"mode", "profile_number", "profile_level_db", "profile_checksum",
                             "measured_g_rms", "control_state"})
        EXPECT_THAT(without(role), AllOf(HasSubstr(std::string("shaker.registers.") + role +
                                                   ".address: found nothing, expected an address"),
                                         HasSubstr("random vibration needs mode, profile_number")))
            << role;
    const auto with = [](const std::string& line) {
        std::string text = kRandomRegisters;
        const auto at = text.find(line.substr(0, line.find(' ')));
        text.replace(at, text.find("\n", at) - at, line);
        return complaint(text, true);
    };
    EXPECT_THAT(with("profile_level_db = { address = 10, type = \"u16\" }"),
                AllOf(StartsWith("rig.toml:4:"), HasSubstr("profile_level_db.type"),
                      HasSubstr("found u16, expected i16, i32 or f32")));
    EXPECT_THAT(with("profile_checksum = { address = 5, type = \"f32\" }"),
                HasSubstr("profile_checksum.type: found f32, expected u32"));
    EXPECT_THAT(with("mode = { address = 8, table = \"input\" }"),
                HasSubstr("mode.table: found \"input\", expected \"holding\""));
    EXPECT_THAT(with("mode = { address = 5 }"),
                HasSubstr("expected written registers that do not"));
    EXPECT_THAT(with("control_state = { address = 9, type = \"bits\" }"),
                HasSubstr("control_state.type: found bits"));
}

const std::string kPsdBlock =
    kRandomRegisters +
    "psd_block = { address = 100, word_order = \"little\", pairs = 300, attempts = 3 }\n";

TEST(PsdBlock, IsWhereItIsStated) {
    const std::string text = "spectrum.controller_psd = \"registers\"\n" + kPsdBlock;
    const auto c = accepted(text, true);
    ASSERT_TRUE(c.shaker.registers.random && c.shaker.registers.random->psd_block);
    const proto::PsdBlock& block = *c.shaker.registers.random->psd_block;
    EXPECT_EQ(block.first.address, 100);
    EXPECT_EQ(block.first.order, proto::WordOrder::little);
    EXPECT_EQ(block.first.table, proto::RegisterTable::input);
    EXPECT_EQ(block.pairs, 300);
    EXPECT_EQ(block.attempts, 3);
    EXPECT_TRUE(c.campaign.read_psd);
    EXPECT_FALSE(accepted(kPsdBlock, true).campaign.read_psd);
    const auto shown = format_effective(parse(as_simulated(text, true), "rig.toml", true));
    EXPECT_THAT(shown, HasSubstr("shaker.registers.psd_block.pairs"));
    const auto none =
        format_effective(parse(as_simulated(kRandomRegisters, true), "rig.toml", true));
    EXPECT_THAT(none, Not(HasSubstr("psd_block.address")));
}

TEST(PsdBlock, OneThatCannotBeReadIsNamed) {
    const auto with = [](const std::string& block) {
        return complaint(kRandomRegisters + "psd_block = { " + block + " }\n", true);
    };
    EXPECT_THAT(with("pairs = 100"), HasSubstr("psd_block.address: found nothing, expected an"));
    EXPECT_THAT(with("address = 100, type = \"u16\""),
                HasSubstr("psd_block.type: found u16, expected f32: pairs of floats"));
    EXPECT_THAT(with("address = 65000, pairs = 200"),
                HasSubstr("found 200 pairs from 65000, expected 134 pairs of 4 words at most"));
    EXPECT_THAT(with("address = 100, access = \"write\""), HasSubstr("psd_block.access"));
    EXPECT_THAT(with("address = 100, pairs = 1"), HasSubstr("psd_block.pairs"));
}

/// What a controller says that it played, at the table, in place of what was to be played.
TEST(ControllerPsd, OfAFileOrAProfileIsWhatReachesThePlatform) {
    const plant::TemporaryFolder folder;
    const std::string path = folder.file("plan.json"), psd = folder.file("psd.json");
    std::ofstream(path) << R"({"runs":[{"position":[0,0,0],"table_g":3},)"
                        << R"({"position":[0,0,0],"profile":"p","level_db":-3}]})";
    const auto text = [&](const std::string& spectrum, const std::string& profile = "") {
        return "campaign.plan = \"" + path + "\"\nspectrum.mode = \"mixed\"\n" +
               "spectrum.mount = \"hard\"\n" + spectrum + kRandomRegisters +
               profile_with("number = 4\nat = \"table\"\npsd = [[20, 0.02], [120, 0.02]]\n" +
                            profile);
    };
    const std::string of_file = "spectrum.controller_psd = \"" + psd + "\"\n";
    const auto write = [&](const std::string& content) { std::ofstream(psd) << content; };
    const auto nominal = accepted(text(""), true);
    write(R"([{"profile":"p","psd":[[20,0.018],[70,0.018],[70.1,0.024],[120,0.024]]}])");
    const auto c = accepted(text(of_file), true);
    // 50 * 0.018 + 50 * 0.024 in place of 2 g^2; the command, its bands and the checksum stay.
    const auto &stop = c.campaign.stops[1], &was = nominal.campaign.stops[1];
    EXPECT_NEAR(stop.random->at_platform.mean_square_g2 / was.random->at_platform.mean_square_g2,
                2.1 / 2, 1e-3);
    EXPECT_EQ(stop.table_g, was.table_g);
    EXPECT_NEAR(stop.transmission, std::sqrt(2.1 / 2), 1e-3);
    EXPECT_EQ(stop.random->set_point.checksum, was.random->set_point.checksum);
    // A recording has no file: the profile says it, and reads back.
    const auto shown = format_effective(parse(as_simulated(text(of_file), true), "rig.toml", true));
    EXPECT_THAT(shown, HasSubstr("controller_psd = [[20.0, 0.018], [70.0, 0.018]"));
    const auto again =
        accepted(text("spectrum.controller_psd = \"profile\"\n",
                      "controller_psd = [[20, 0.018], [70, 0.018], [70.1, 0.024], [120, 0.024]]\n"),
                 true);
    EXPECT_EQ(again.campaign.stops[1].random->at_platform.mean_square_g2,
              stop.random->at_platform.mean_square_g2);

    const auto said = [&](const std::string& content) {
        write(content);
        return complaint(text(of_file), true);
    };
    EXPECT_THAT(complaint(text("spectrum.controller_psd = \"registers\"\n"), true),
                AllOf(HasSubstr("spectrum.controller_psd"),
                      HasSubstr("found \"registers\" without shaker.registers.psd_block, expected "
                                "its address")));
    EXPECT_THAT(complaint(text("spectrum.controller_psd = \"nowhere.json\"\n"), true),
                HasSubstr("nowhere.json: cannot be read"));
    EXPECT_THAT(said("{}"), HasSubstr("psd.json: found {}, expected a JSON list"));
    EXPECT_THAT(
        said(R"([{"profile":"q","psd":[[20,0.02],[120,0.02]]}])"),
        HasSubstr("psd.json: [0].profile: found \"q\", expected the name of a [[profile]]"));
    EXPECT_THAT(said(R"([{"profile":"p","psd":[[20,0.02],[10,0.02]]}])"),
                AllOf(HasSubstr("psd[1]: found 10 Hz after 20 Hz"), HasSubstr("growing")));
    EXPECT_THAT(said(R"([{"profile":"p","psd":[[20,0.02],[120,0]]}])"),
                HasSubstr("psd[1]: found 0 g^2/Hz, expected a density above 0"));
    EXPECT_THAT(
        said(R"([{"profile":"p","psd":[[20,0.05],[120,0.05]]}])"),
        HasSubstr("found controller_psd of 2.2361 g rms, expected that of the profile within "
                  "3 dB: 1.4142"));
    EXPECT_THAT(said(R"([{"profile":"p"}])"), HasSubstr("[0].psd: found nothing"));
}

TEST(RandomDwells, OfAPlanAreStopsWithChecksumLevelAndBands) {
    const plant::TemporaryFolder folder;
    const std::string path = folder.file("plan.json");
    const auto text = [&](const std::string& run, const std::string& profile,
                          const std::string& mode = "mixed") {
        std::ofstream(path) << R"({"runs":[{"position":[0,0,0],"table_g":3},{"position":[0,0,0],)"
                            << run << "}]}";
        return "campaign.plan = \"" + path + "\"\nspectrum.mode = \"" + mode + "\"\n" +
               kRandomRegisters + profile_with(profile);
    };
    const auto said = [&](const std::string& run, const std::string& profile) {
        return complaint(text(run, profile), true);
    };
    const std::string psd = "psd = [[20, 0.02], [120, 0.02]]\n";
    const std::string whole = psd + "number = 4\nat = \"table\"\n";
    const auto c = accepted(text(R"("profile":"p","level_db":-3.0)", whole), true);
    ASSERT_EQ(c.campaign.stops.size(), 2U);
    const auto& stop = c.campaign.stops[1];
    ASSERT_TRUE(stop.random);
    EXPECT_EQ(stop.random->set_point.profile, 4);
    EXPECT_EQ(stop.random->set_point.level_db, -3);
    // zlib.crc32(struct.pack(">4f", 20, 0.02, 120, 0.02))
    EXPECT_EQ(stop.random->set_point.checksum, 0xbb19bad6U);
    // sqrt(2) g less 3 dB, and a flat band's width
    EXPECT_NEAR(stop.table_g, std::sqrt(2.0) * std::pow(10, -0.15), 1e-6);
    ASSERT_EQ(c.abort_bands.size(), 1U);
    EXPECT_EQ(stop.random->place, 1);
    EXPECT_NEAR(c.abort_bands[0].table_bandwidth_hz, 100, 0.5);
    // Behind the pads it is less, and narrower.
    EXPECT_LT(stop.transmission, 0.4);
    EXPECT_LT(c.abort_bands[0].platform_bandwidth_hz, 50);
    EXPECT_NEAR(stop.random->at_platform.mean_square_g2,
                std::pow(stop.table_g * stop.transmission, 2), 1e-9);
    EXPECT_EQ(stop.random->at_platform.gain_error, 0.01);

    // The same from a CSV file, its errors with line and column.
    const std::string csv = folder.file("plan.csv");
    const auto of_csv = [&](const std::string& row) {
        std::ofstream(csv) << "alpha_deg,beta_deg,gamma_deg,table_g,profile,level_db\n0,0,0,3,,\n"
                           << row << "\n";
        return "campaign.plan = \"" + csv + "\"\nspectrum.mode = \"mixed\"\n" + kRandomRegisters +
               profile_with(whole);
    };
    const auto same = accepted(of_csv("0,0,0,,p,-3"), true);
    ASSERT_EQ(same.campaign.stops.size(), 2U);
    ASSERT_TRUE(same.campaign.stops[1].random);
    EXPECT_EQ(same.campaign.stops[1].random->set_point.checksum, 0xbb19bad6U);
    EXPECT_EQ(same.campaign.stops[1].table_g, stop.table_g);
    EXPECT_THAT(complaint(of_csv("0,0,0,,q,0"), true),
                HasSubstr("plan.csv:3: column profile: found 'q', expected the name or number"));

    EXPECT_THAT(said(R"("profile":"q")", whole),
                AllOf(HasSubstr("runs[1].profile: found 'q'"), HasSubstr("one of p")));
    EXPECT_THAT(said(R"("profile":"p")", psd + "at = \"table\"\n"),
                HasSubstr("found 'p' without a number, expected its number in the controller"));
    EXPECT_THAT(said(R"("profile":"p")", psd + "number = 4\n"),
                HasSubstr("at the platform, behind isolators, expected at = \"table\""));
    EXPECT_THAT(said(R"("profile":"p","table_g":3)", whole),
                HasSubstr("runs[1].table_g: found 3 beside a profile, expected level_db alone"));
    EXPECT_THAT(said(R"("sweep":{"from_hz":20},"table_g":3)", whole),
                HasSubstr("runs[1].sweep.to_hz: found nothing, expected a number"));
    EXPECT_THAT(said(R"("profile":"p","level_db":20)", whole), HasSubstr("3 sigma of 42.4"));
    EXPECT_THAT(complaint(text(R"("profile":"p")", whole, "sine"), true),
                HasSubstr("expected spectrum.mode \"mixed\" for random vibration"));
}

const char* const kSweepRegisters =
    "shaker.registers.mode.address = 8\n"
    "shaker.registers.sweep_from = { address = 11, type = \"u32\", scale = 0.001 }\n"
    "shaker.registers.sweep_to = { address = 13, type = \"u32\", scale = 0.001 }\n"
    "shaker.registers.sweep_rate = { address = 15, scale = 0.01 }\n"
    "shaker.registers.actual_frequency = { address = 10, table = \"input\", type = \"u32\", "
    "scale = 0.001 }\n";

TEST(SpectrumKeys, APlanWithASweepNeedsRegistersRateAndLimits) {
    const plant::TemporaryFolder folder;
    const std::string plan = folder.file("plan.json");
    const auto text = [&](const std::string& sweep, double table_g, const std::string& more) {
        std::ofstream(plan) << R"({"runs":[{"position":[0,0,0],"table_g":6,"frequency_hz":15},)"
                            << R"({"position":[0,0,45],"table_g":)" << table_g << R"(,"sweep":{)"
                            << sweep << "}}]}";
        return "campaign.plan = \"" + plan + "\"\n" + more;
    };
    const std::string up = R"("from_hz":20,"to_hz":120,"s":300)";
    const std::string whole = std::string(kSweepRegisters) + "spectrum.mode = \"mixed\"\n" +
                              "spectrum.mount = \"hard\"\ncan.sample_rate_hz = 400\n";
    const auto c = accepted(
        text(up, 6, whole + "accelerometer.bandwidth_hz = 200\naccelerometer.order = 2\n"), true);
    ASSERT_EQ(c.campaign.stops.size(), 2U);
    const auto& stop = c.campaign.stops[1];
    EXPECT_EQ(stop.sweep, (estimator::SweptSine{20, 120, 300}));
    EXPECT_EQ(stop.frequency_hz, 0);
    EXPECT_FALSE(stop.random);
    EXPECT_NE(stop.kind(), c.campaign.stops[0].kind());
    // What the accelerometers show along it: Butterworth, order 2, 200 Hz.
    EXPECT_NEAR(stop.along.front(), 1 / std::sqrt(1 + std::pow(0.1, 4)), 1e-9);
    EXPECT_NEAR(stop.along.back(), 1 / std::sqrt(1 + std::pow(0.6, 4)), 1e-9);
    EXPECT_GT(stop.along[4], stop.along.back());

    const auto said = [&](const std::string& sweep, double table_g, const std::string& more) {
        return complaint(text(sweep, table_g, more), true);
    };
    EXPECT_EQ(said(up, 6, whole), "");
    EXPECT_THAT(said(up, 6, "spectrum.mount = \"hard\"\ncan.sample_rate_hz = 400\n"),
                HasSubstr("a sweep from 20 to 120 Hz without registers for it, expected "
                          "shaker.registers.mode, sweep_from"));
    EXPECT_THAT(said(up, 6, std::string(kSweepRegisters) + "spectrum.mount = \"hard\"\n"),
                HasSubstr("spectrum.mode \"mixed\" for sweeps"));
    EXPECT_THAT(said(up, 6,
                     std::string(kSweepRegisters) +
                         "spectrum.mode = \"mixed\"\nspectrum.mount = \"hard\"\n"),
                HasSubstr("at 40 samples/s, expected 100 at least"));
    EXPECT_THAT(said(R"("from_hz":8,"to_hz":120,"s":300)", 6, whole),
                HasSubstr("at 6 g, expected 3.0917 g at most, at 8 Hz"));
    EXPECT_THAT(said(R"("from_hz":120,"to_hz":5,"s":300)", 2, whole), HasSubstr("g at most, at"));
    EXPECT_THAT(said(up, 0, whole), HasSubstr("at 0 g, expected a level"));
    EXPECT_THAT(said(R"("from_hz":20,"to_hz":120,"s":80000)", 6, whole),
                HasSubstr("in 80000 s, 0.0019387 octaves a minute, expected 0.01 at least"));
    EXPECT_THAT(said(up, 6, whole + "accelerometer.bandwidth_hz = 60\n"),
                HasSubstr("expected frequencies of which they see half of the power at least"));
    EXPECT_THAT(said(up, 6, whole + "estimator.method = \"two-step\"\n"),
                HasSubstr("the two-step route has coefficients at one frequency only"));
    // Isolators amplify below sqrt 2 of their own frequency.
    EXPECT_THAT(said(R"("from_hz":9,"to_hz":120,"s":300)", 1,
                     std::string(kSweepRegisters) +
                         "spectrum.mode = \"mixed\"\ncan.sample_rate_hz = 400\n"),
                HasSubstr("below it the isolators amplify"));
}

TEST(SpectrumKeys, RegistersOfSweepsAreAllThereOrNone) {
    std::string some = kSweepRegisters;
    some = some.substr(0, some.find("shaker.registers.sweep_rate"));
    EXPECT_THAT(complaint(some, true),
                AllOf(HasSubstr("shaker.registers.sweep_rate.address: found nothing"),
                      HasSubstr("shaker.registers.actual_frequency.address: found nothing")));
    EXPECT_EQ(complaint(kSweepRegisters, true), "");
    const auto c = accepted(kSweepRegisters, true);
    ASSERT_TRUE(c.shaker.registers.sweep);
    EXPECT_FALSE(c.shaker.registers.random);
    EXPECT_EQ(c.shaker.registers.sweep->rate.scale, 0.01);
    // What is written is no input register.
    std::string input = kSweepRegisters;
    input.replace(input.find("type = \"u32\""), 0, "table = \"input\", ");
    EXPECT_THAT(complaint(input, true), AllOf(HasSubstr("shaker.registers.sweep_from.table"),
                                              HasSubstr("this register is written")));
}

}  // namespace
}  // namespace vibrig::configuration
