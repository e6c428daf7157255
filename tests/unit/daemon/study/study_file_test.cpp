#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/study/campaigns.hpp"
#include "daemon/study/study.hpp"

namespace vibrig::study {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

const std::string kHead = "[study]\nname = 'a'\nkind = 'campaigns'\n";

std::string complaint(const std::string& text) {
    try {
        const Study study = parse_study(text, "S.toml");
        static_cast<void>(check_campaigns(study, "S.toml"));
    } catch (const StudyError& error) {
        return error.what();
    }
    return "";
}

TEST(StudyFile, OfTheSpecificationIsTaken) {
    const Study study = parse_study(kHead + R"(
seed = 1
runs = 1000
[campaign]
table_g = [9.0, 7.0]
[rig]
"platform.slew_error_deg" = { normal = [0.0, 0.1] }
"accelerometer.misalignment_arcsec" = { rectangular = [-50, 50] }
[grid]
"campaign.table_g" = [[9, 7], [9, 0]]
[identify]
)",
                                    "S.toml");
    EXPECT_EQ(study.points(), 2U);
    EXPECT_EQ(study.tasks(), 2000U);
    EXPECT_EQ(check_campaigns(study, "S.toml").size(), 2U);
}

TEST(StudyFile, OfThreeAxesCountsTheFirstSlowest) {
    const Study study = parse_study(kHead + R"([grid]
"campaign.dwell_s" = [10, 20]
"isolator.cross_axis" = [[0, 0], [0.1, 0], [0, 0.1]]
"identify.noise.resolver_arcsec" = [5, 6]
)",
                                    "S.toml");
    EXPECT_EQ(study.points(), 12U);
    EXPECT_EQ(study.place_of(0), (std::vector<std::size_t>{0, 0, 0}));
    EXPECT_EQ(study.place_of(11), (std::vector<std::size_t>{1, 2, 1}));
    EXPECT_EQ(study.place_of(1), (std::vector<std::size_t>{0, 0, 1}));
    // Only the configuration's axes make configurations.
    EXPECT_EQ(combination_of(study, 11), 3U);
    EXPECT_EQ(combination_of(study, 2), 0U);
}

TEST(StudyFile, OfOtherKindsMayHaveTheHeadOfAll) {
    // GIVEN the head of the specification with another kind
    const std::string head = "[study]\nname = 'a'\nseed = 1\nruns = 1000\n";
    const Study recordings =
        parse_study(head + "kind = 'recordings'\nfolders = ['/lab']\n", "S.toml");
    EXPECT_THAT(recordings.warnings,
                ::testing::UnorderedElementsAre(
                    "S.toml:3:8: study.seed: found 1, without effect in a study of kind "
                    "\"recordings\"",
                    "S.toml:4:8: study.runs: found 1000, without effect in a study of kind "
                    "\"recordings\""));
    // THEN of trials the fewest are a block, whatever runs there are
    const Study trials = parse_study(
        head + "kind = 'uncertainty'\nrecording = '/lab/a'\ntrials = 10000\n", "S.toml");
    EXPECT_EQ(trials.tasks(), 1U);
    ASSERT_EQ(trials.warnings.size(), 1U);
    EXPECT_THAT(trials.warnings[0], HasSubstr("study.runs: found 1000, without effect"));
    EXPECT_THAT(complaint(head + "kind = 'uncertainty'\nrecording = '/lab/a'\ntrials = 9999\n"),
                HasSubstr("study.trials: found 9999, expected a whole number from 10000"));
    EXPECT_TRUE(parse_study(kHead, "S.toml").warnings.empty());
}

TEST(StudyFile, ThatIsWrongIsNamedByPlaceValueAndWhatWasExpected) {
    EXPECT_THAT(
        complaint(kHead + "runs = 1000\n[grid]\n\"campaign.dwell_s\" = " +
                  "[10,11,12,13,14,15,16,17,18,19]\n\"site.azimuth_deg\" = " +
                  "[0,1,2,3,4,5,6,7,8,9]\n\"drift.bias_walk_deg_h_rt_h\" = " +
                  "[0,1,2,3,4,5,6,7,8,9]\n\"noise.resolver_arcsec\" = [" +
                  "0,1,2,3,4,5,6,7,8,9]\n\"drift.bias_scatter_deg_h\" = [0,1,2,3,4,5,6,7,8,9]\n"),
        "S.toml:5:1: grid: found 1e+08 tasks, expected at most 1e7: the product of the "
        "lists' lengths and study.runs");
    std::string ten_thousand = "[0";
    for (int i = 1; i < 10'000; ++i) ten_thousand += "," + std::to_string(1e-4 * i);
    EXPECT_THAT(
        complaint(kHead + "runs = 10000\n[grid]\n\"noise.resolver_arcsec\" = " + ten_thousand +
                  "]\n\"drift.bias_scatter_deg_h\" = " + ten_thousand + "]\n"),
        HasSubstr("grid: found 1e+12 tasks, expected at most 1e7"));
    EXPECT_THAT(complaint(kHead + "[rig]\n\"noise.resolver_arcsec\" = { normal = [] }\n"),
                HasSubstr("expected { normal = [MEAN, SIGMA] }"));
    EXPECT_THAT(complaint(kHead + "[rig]\n\"noise.resolver_arcsec\" = { normal = [5] }\n"),
                StartsWith("S.toml:5:27: rig.noise.resolver_arcsec: found { \"normal\" = [5] }, "
                           "expected { normal = [MEAN, SIGMA] }, or"));
    EXPECT_THAT(complaint(kHead + "[rig]\n\"noise.resolver_arcsec\" = { normal = [5, 0] }\n"),
                HasSubstr("expected a sigma above 0"));
    // A distribution so wide that next to nothing of it lies in the key's range
    EXPECT_THAT(complaint(kHead + "[rig]\n\"platform.slew_error_deg\" = { normal = [0, 1e300] }\n"),
                StartsWith("S.toml:5:29: rig.platform.slew_error_deg: found { \"normal\" = [0, "));
    EXPECT_THAT(complaint(kHead + "[rig]\n\"platform.slew_error_deg\" = { normal = [0, 2000] }\n"),
                HasSubstr("expected a sigma above 0, and values from 0 to 5 not to be too rare"));
    EXPECT_THAT(complaint("[study]\nname = \"a\\nb\"\nkind = 'campaigns'\n"),
                StartsWith("S.toml:2:8: study.name: found \"a\\nb\" (a string), expected 1 to 64 "
                           "characters on one line"));
    EXPECT_THAT(complaint(kHead + "[rig]\n\"noise.resolver_arcsec\" = { rectangular = [-1, 5] }\n"),
                HasSubstr("expected LOW below HIGH, both from 0 to 100000"));
    EXPECT_THAT(complaint(kHead + "[rig]\n\"noise.resolver_bits\" = { normal = [20, 1] }\n"),
                HasSubstr("expected a value: this key is not drawn"));
    EXPECT_THAT(complaint(kHead + "[rig]\n\"noise.resolver\" = 3\n"),
                AllOf(StartsWith("S.toml:5:20: rig.noise.resolver: found 3"),
                      HasSubstr("resolver_arcsec")));
    EXPECT_THAT(complaint(kHead + "[rig]\n\"noise.resolver_arcsec\" = -3\n"),
                AllOf(StartsWith("S.toml:5:27: "), HasSubstr("noise.resolver_arcsec"),
                      HasSubstr("found -3")));
    EXPECT_THAT(complaint(kHead + "[campaign]\ndwell_s = 1\n"),
                StartsWith("S.toml:5:11: campaign.dwell_s: found 1"));
    EXPECT_THAT(complaint(kHead + "[campaign]\nlevelling = true\n"),
                HasSubstr("a study has dwells only"));
    EXPECT_THAT(complaint(kHead + "[identify.server]\nsocket = '/x'\n"),
                StartsWith("S.toml:5:10: identify.server.socket: found"));
    EXPECT_THAT(complaint(kHead + "[grid]\n\"campaign.dwell_s\" = 10\n"),
                HasSubstr("expected a list of 1 to 10000 values"));
    EXPECT_THAT(complaint(kHead + "[grid]\n\"campaign.table_g\" = [[9, 7], [9, 0], [9, 7]]\n"),
                AllOf(StartsWith("S.toml:5:"), HasSubstr("grid.\"campaign.table_g\": found "),
                      HasSubstr(" again, expected each value once")));
    EXPECT_THAT(complaint(kHead + "runs = 0\n"),
                "S.toml:4:8: study.runs: found 0, expected a whole number from 1 to 10000000");
    EXPECT_THAT(complaint("[study]\nname = 'a'\nkind = 'uncertainty'\n"),
                HasSubstr("study.recording: found nothing, expected a campaign's folder"));
    EXPECT_THAT(complaint("[study]\nname = 'a'\nkind = 'wonder'\n"),
                HasSubstr("study.kind: found \"wonder\" (a string), expected \"campaigns\", "));
    EXPECT_THAT(complaint("[study]\nname = 'a'\nkind = 'recordings'\n"),
                HasSubstr("study.folders: found nothing, expected a list of folders"));
    EXPECT_THAT(complaint("[study]\nname = 'a'\nkind = 'recordings'\nfolders = ['']\n"),
                StartsWith("S.toml:4:11: study.folders: found an array of 1"));
    EXPECT_THAT(complaint("[study]\nname = 'a'\nkind = 'recordings'\nfolders = ['/lab']\n"
                          "digits = 3\n[rig]\n"),
                AllOf(HasSubstr("study.digits: found 3, expected it not to be set in a study of "
                                "kind \"recordings\""),
                      HasSubstr("rig: found a table")));
    EXPECT_THAT(complaint(kHead + "folders = ['/lab']\n"),
                HasSubstr("study.folders: found an array of 1, expected it not to be set"));
    EXPECT_THAT(complaint("[campaign]\n"), HasSubstr("study: found nothing"));
    EXPECT_THAT(complaint("[study\n"), StartsWith("S.toml:1:"));
}

}  // namespace
}  // namespace vibrig::study
