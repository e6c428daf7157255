#include "tests/unit/daemon/tool/analysis/predict_fixture.hpp"

namespace vibrig::tool {
namespace {

using ::testing::HasSubstr;

/// Octave bands and a broad one, which a configuration and a controller know by number.
class PredictRandom : public Predict {
  protected:
    static void SetUpTestSuite() {
        Predict::SetUpTestSuite();
        std::ifstream in(folder() / "truth.json");
        PredictJson truth = PredictJson::parse(in);
        truth["shaker"]["limit_mm"] = 100;
        std::string config = "[spectrum]\nmount = \"hard\"\n";
        for (const auto& [number, low, high, density] : std::vector<std::array<double, 4>>{
                 {1, 18, 36, 0.5}, {2, 36, 72, 0.25}, {3, 72, 144, 0.125}, {4, 20, 120, 0.09}}) {
            const PredictJson psd = {{low, density}, {high, density}};
            truth["shaker"]["profiles"].push_back(
                {{"number", static_cast<int>(number)}, {"psd", psd}});
            config += "[[profile]]\nname = \"band " + std::to_string(static_cast<int>(number)) +
                      "\"\nnumber = " + std::to_string(static_cast<int>(number)) +
                      "\nat = \"table\"\npsd = " + psd.dump() + "\n";
        }
        write("random.json", truth.dump());
        write("random.toml", config + "[shaker.limits]\ndisplacement_mm = 100\n");
        // Held out: 3 g rms of the broad band, which is its level, and half of it.
        ASSERT_EQ(plant("--truth random.json --seed 7 --dwell 60 --table-g 3,2.12 --profile 4,4 "
                        "--positions held.csv -o random_held.csv")
                      .exit_code,
                  0)
            << content("error");
    }
};

TEST_F(PredictRandom, HeldOutRandomDwellsConfirm) {
    const std::string arguments =
        "predict result.json --profile 'band 4' --verify random_held.csv --config random.toml "
        "--json";
    const Ended ended = run(arguments);
    ASSERT_EQ(ended.exit_code, 0) << ended.error << ended.out;
    const PredictJson prediction = ended.json()["prediction"];
    EXPECT_EQ(prediction["verification"]["word"], "confirmed") << ended.out;
    EXPECT_EQ(prediction["verification"]["dof"], 18);
    // What happened is known to 1 % and more, and how it lay over the bands not at all.
    EXPECT_GT(prediction["attitudes"][0]["budget"]["realisation"][0], 0);
}

TEST_F(PredictRandom, HeldOutRandomDwellsContradictAResultWithoutItsElasticPart) {
    write_without_elastic_part("broken.json");
    const Ended ended =
        run("predict broken.json --profile 'band 4' --verify random_held.csv --config random.toml");
    EXPECT_EQ(ended.exit_code, 1) << ended.error;
    EXPECT_THAT(ended.out, HasSubstr("contradicted"));
}

TEST_F(PredictRandom, RandomDwellsFindTheResonance) {
    ASSERT_EQ(plant("--truth random.json --seed 8 --dwell 60 --table-g 6,0,3,3,3 --frequency "
                    "15,15,15,15,15 --profile 0,0,1,2,3 -o bands.csv")
                  .exit_code,
              0)
        << content("error");
    const Ended found = run("identify bands.csv --config random.toml --json");
    ASSERT_EQ(found.exit_code, 0) << found.error << found.out.substr(0, 2000);
    const PredictJson json = found.json();
    const PredictJson& spectrum = json["spectrum"];
    ASSERT_EQ(spectrum["frequencies"].size(), 4U);
    EXPECT_TRUE(spectrum["frequencies"][0]["profile"].is_null());
    EXPECT_EQ(spectrum["frequencies"][2]["profile"], "band 2");
    EXPECT_EQ(spectrum["model"], "resonance");
    for (std::size_t gyro = 0; gyro < 3; ++gyro) {
        const PredictJson& one = spectrum["resonance"][gyro];
        const double wide =
            one["hz_interval"][1].get<double>() - one["hz_interval"][0].get<double>();
        // Some 4 standard deviations of it lie within an interval of 95 %.
        EXPECT_NEAR(one["hz"].get<double>(), 60, wide) << gyro;
        EXPECT_LT(wide, 6);
    }
    // Of 2400 slow samples 2.9 %, of 18 Hz over 60 s and a gain to 1 % some 3.2 %.
    const PredictJson& row = json["dwell_rates"][28];
    EXPECT_EQ(row["profile"], "band 1");
    EXPECT_NEAR(row["r_relative_error"].get<double>(), 0.0215, 0.001);
    write("bands.json", found.out);
    const Ended ended =
        run("predict bands.json --profile 'band 4' --verify random_held.csv --config random.toml");
    EXPECT_EQ(ended.exit_code, 0) << ended.error << ended.out;
    EXPECT_THAT(ended.out, HasSubstr("confirmed"));
    const Ended text = run("identify bands.csv --config random.toml");
    EXPECT_THAT(text.out, HasSubstr("14 dwells under band 1"));
}

TEST_F(PredictRandom, WhatARecordingSaysOfItsProfilesIsRefusedByPlaceAndValue) {
    const auto refused = [&](const std::string& arguments, const std::string& message) {
        const Ended ended = run(arguments);
        EXPECT_EQ(ended.exit_code, 2) << arguments;
        EXPECT_THAT(ended.error, HasSubstr(message));
    };
    refused("identify random_held.csv --config random.toml",
            "random_held.csv: found random vibration alone, expected dwells at one sine frequency");
    refused("identify random_held.csv",
            "random_held.csv:2: column profile: found '4', expected the name or number of a "
            "[[profile]]");
    const std::string head = "time_s,run,position,alpha_deg,beta_deg,gamma_deg,ax_g,ay_g,az_g,";
    write("mixed.csv", head + "profile\n0,1,1,0,0,0,0,1,0,band 1\n1,1,1,0,0,0,0,1,0,band 2\n");
    refused("identify mixed.csv --config random.toml",
            "mixed.csv:3: column profile: found another profile");
    write("mixed.csv", head + "frequency_hz,profile\n0,1,1,0,0,0,0,1,0,15,1\n");
    refused("identify mixed.csv --config random.toml",
            "mixed.csv:2: column frequency_hz: found 15.000000 with profile '1'");
    write("spectra.json", R"([{"run": 1, "position": 1, "profile": "band 1", "lines": []}])");
    refused("identify random_held.csv --spectra spectra.json",
            "spectra.json: [0].lines: found more beside it");
    write("spectra.json", R"([{"run": 1, "position": 1, "psd": [[20, 0]]}])");
    refused("identify random_held.csv --spectra spectra.json", "[0].psd[0]: found [20,0]");
    refused("predict result.json --profile 'band 3' --verify random_held.csv --config random.toml",
            "found no dwell under the profile 'band 3'");
}

}  // namespace
}  // namespace vibrig::tool
