#include <cmath>
#include <fstream>
#include <string>

#include "tests/unit/daemon/configuration/spectrum_keys.hpp"
#include "tests/unit/daemon/configuration/support.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::configuration {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

/// What a controller reports as played, at the table, in place of what was to be played.
TEST(ControllerPsd, OfAFileOrAProfileIsWhatReachesThePlatform) {
    const TemporaryFolder folder;
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
    const TemporaryFolder folder;
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

}  // namespace
}  // namespace vibrig::configuration
