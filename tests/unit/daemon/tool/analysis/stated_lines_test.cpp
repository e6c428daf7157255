#include "tests/unit/daemon/tool/analysis/predict_fixture.hpp"

namespace vibrig::tool {
namespace {

using ::testing::HasSubstr;

TEST_F(Predict, SpectraThatCannotBeAreRefused) {
    ASSERT_EQ(
        plant("--truth truth.json --dwell 5 --table-g 6 --frequency 60 -o at60.csv").exit_code, 0);
    write("closed.json", spectra_of("[[60, 6]]"));
    Ended ended = run("identify at60.csv --spectra closed.json");
    EXPECT_EQ(ended.exit_code, 2) << ended.out;
    EXPECT_THAT(ended.error, HasSubstr("--spectra: found 60 Hz at 40 samples/s"));
    // A dwell that is said to have shaken, and did not.
    ASSERT_EQ(plant("--truth truth.json --dwell 5 --table-g 0 -o rest.csv").exit_code, 0);
    write("shaken.json", spectra_of("[[15, 6]]"));
    ended = run("identify rest.csv --spectra shaken.json");
    EXPECT_EQ(ended.exit_code, 2) << ended.out;
    EXPECT_THAT(ended.error, HasSubstr("found a dwell in which nothing vibrates, expected 15 Hz"));
}

TEST_F(Predict, HarmonicsOfASineAreLinesAndTheStrongestIsItsFrequency) {
    ASSERT_EQ(plant("--truth truth.json --dwell 20 --table-g 6 -o sine.csv").exit_code, 0);
    write("harmonic.json", spectra_of("[[30, 0.3], [15, 6]]"));
    const Ended ended = run("identify sine.csv --spectra harmonic.json --json");
    ASSERT_NE(ended.exit_code, 2) << ended.error;
    const PredictJson rows = ended.json()["dwell_rates"];
    EXPECT_EQ(rows.size(), 14U) << ended.error;
    EXPECT_EQ(ended.json()["spectrum"]["frequencies"][0]["hz"], 15);
}

TEST_F(Predict, LinesThatTheSamplesDoNotShowAreRefused) {
    // GIVEN dwells at one sine
    ASSERT_EQ(plant("--truth truth.json --dwell 20 --table-g 6 -o sine.csv").exit_code, 0);
    const std::string eight =  // 15 Hz with a third of the power, and seven more
        "[[15, 6], [26, 3], [28, 3], [31, 3], [33, 3], [51, 3], [53.5, 3], [65.9, 3]]";
    const std::array<std::array<std::string, 2>, 3> lies{
        {{"[[15, 6], [33, 6]]", "run 1, position 1: 33 Hz with "},  // it shakes with half of them
         {"[[15, 6], [33, 3]]", ": 33 Hz with "},                   // with another fifth
         {eight, ": 15 Hz with "}}};
    for (const auto& [lines, words] : lies) {
        write("lie.json", spectra_of(lines));
        const Ended ended = run("identify sine.csv --spectra lie.json");
        // THEN it is refused, with the first dwell and the line that is furthest from its share
        EXPECT_EQ(ended.exit_code, 2) << ended.out;
        EXPECT_THAT(ended.error, HasSubstr(words));
    }
    // Where the strongest line is not there, no dwell is left: nothing is determined.
    write("lie.json", spectra_of("[[33, 6], [27, 2]]"));
    const Ended ended = run("identify sine.csv --spectra lie.json");
    EXPECT_EQ(ended.exit_code, 1) << ended.error;
    EXPECT_THAT(ended.out, HasSubstr("not at its commanded frequency within 0.05 Hz: dwell rej"));
}

TEST_F(Predict, LinesThatCannotBeToldApartAreBelievedWhereSamplesAreLostToo) {
    // GIVEN dwells at 15 Hz and 40 samples/s, of which every tenth is lost
    ASSERT_EQ(plant("--truth truth.json --dwell 20 --table-g 6 -o sine.csv").exit_code, 0);
    std::istringstream all(content("sine.csv"));
    std::string left, line;
    for (int i = 0; std::getline(all, line); ++i)
        if (i % 10 != 9) left += line + '\n';
    write("lost.csv", left);
    // WHEN a line of 25 Hz is stated, which these samples show at 15 Hz
    write("two.json", spectra_of("[[15, 6], [25, 1]]"));
    // THEN nothing is held against it
    EXPECT_NE(run("identify lost.csv --spectra two.json").exit_code, 2);
}

TEST_F(Predict, SpectraOfARecordingWithoutTheColumn) {
    ASSERT_EQ(plant("--truth truth.json --dwell 5 --table-g 6 -o plain.csv").exit_code, 0);
    write("spectra.json", R"([{"run": 1, "position": 1, "lines": [[15, -6]]}])");
    const Ended ended = run("identify plain.csv --spectra spectra.json");
    EXPECT_EQ(ended.exit_code, 2);
    EXPECT_THAT(ended.error, HasSubstr("spectra.json: [0].lines[0]: found [15,-6]"));
    write("spectra.json", R"([{"run": 1, "position": 1, "lines": [[15, 6], [15, 1]]}])");
    const Ended twice = run("identify plain.csv --spectra spectra.json");
    EXPECT_EQ(twice.exit_code, 2);
    EXPECT_THAT(twice.error, HasSubstr("spectra.json: [0].lines[1]: found 15 Hz as in [0]"));
    EXPECT_EQ(run("identify plain.csv --spectrum bent").exit_code, 2);
}

}  // namespace
}  // namespace vibrig::tool
