// What a result says of itself, and by which dwells a sine is proven.
#include "tests/unit/daemon/tool/analysis/predict_fixture.hpp"

namespace vibrig::tool {
namespace {

using ::testing::HasSubstr;

TEST_F(Predict, AResultThatIsNotValidForetellsNothing) {
    PredictJson of = result();
    of["verdict"]["level"] = 2;
    of["verdict"]["sentence"] = "not valid, because of the moon";
    write("moon.json", of.dump());
    const std::string command = "predict moon.json --profile sine.json --attitude 0,0,0";
    const Ended refused = run(command);
    EXPECT_EQ(refused.exit_code, 2) << refused.out;
    EXPECT_THAT(refused.error, HasSubstr("moon.json: verdict: found \"not valid, because of the "
                                         "moon\", expected a result that is valid"));
    const Ended forced = run(command + " --force");
    EXPECT_EQ(forced.exit_code, 1) << forced.error;
    EXPECT_THAT(forced.out, HasSubstr("FORCED: the result is not valid, because of the moon"));
    of["verdict"]["level"] = 1;
    of["verdict"]["sentence"] = "doubtful, because of the moon";
    write("moon.json", of.dump());
    const Ended doubtful = run(command + " --json");
    EXPECT_EQ(doubtful.exit_code, 0) << doubtful.error;
    EXPECT_EQ(doubtful.json()["prediction"]["note"], "the result is doubtful, because of the moon");
    // Its reasons are of use whole.
    const std::string why = "doubtful, because " + std::string(100, 'x') + " and the moon";
    of["verdict"]["sentence"] = why;
    write("moon.json", of.dump());
    EXPECT_EQ(run(command + " --json").json()["prediction"]["note"], "the result is " + why);
    of["verdict"]["level"] = "2";
    write("moon.json", of.dump());
    EXPECT_THAT(run(command).error, HasSubstr("moon.json: verdict.level: found \"2\", expected 0"));
}

TEST_F(Predict, AResultThatSaysNothingOfItselfForetellsNothing) {
    PredictJson of = result();
    of.erase("verdict");
    write("mute.json", of.dump());
    const std::string command = "predict mute.json --profile sine.json --attitude 0,0,0";
    EXPECT_EQ(run(command).exit_code, 2);
    EXPECT_THAT(run(command).error, HasSubstr("mute.json: verdict: found nothing, expected"));
    // What a campaign at one frequency gives is no other program's.
    of = result();
    of.erase("spectrum");
    write("mute.json", of.dump());
    EXPECT_THAT(run(command).error,
                HasSubstr("mute.json: spectrum: found nothing, expected a result over frequency"));
}

TEST_F(Predict, OfASimulatedRigItSaysSo) {
    const std::string command = " --profile sine.json --attitude 0,0,0";
    EXPECT_THAT(run("predict result.json" + command).out, ::testing::StartsWith("SIMULATED: "));
    EXPECT_EQ(run("predict result.json --json" + command).json()["simulated"], true);
    PredictJson real = result();
    real["simulated"] = false;
    write("real.json", real.dump());
    EXPECT_THAT(run("predict real.json" + command).out, ::testing::StartsWith("55 Hz: "));
    // Also where what is to prove it is simulated.
    const Ended held = run("predict real.json --verify held_out.csv --config held.toml" + command);
    EXPECT_THAT(held.out, ::testing::StartsWith("SIMULATED: ")) << held.error;
}

TEST_F(Predict, ARecordingThatItsConfigurationDoesNotFitProvesNothing) {
    write("off.toml",
          "[vibration]\nfrequency_hz = 55.0\n[platform]\nencoder_zero_deg = [1, 0, 0]\n");
    const Ended ended =
        run("predict result.json --profile sine.json --verify held_out.csv --config off.toml "
            "--json");
    EXPECT_EQ(ended.exit_code, 1) << ended.error;
    EXPECT_THAT(
        ended.json()["prediction"]["note"].dump(),
        HasSubstr("held_out.csv: the configuration does not fit the recording: mean force"));
}

/// Else the drift is predicted for the other place, without a word.
TEST_F(Predict, WhereAProfileHoldsIsSaidOnce) {
    write("flat.json", R"({"name": "flat", "psd": [[20, 0.01], [120, 0.01]], "at": "platform"})");
    write("road.toml", "[[profile]]\nname = \"road\"\npsd = [[20, 0.01], [120, 0.01]]\n");
    const std::string command = "predict result.json --attitude 0,0,0 --profile ";
    const Ended file = run(command + "flat.json --at table");
    EXPECT_EQ(file.exit_code, 2) << file.out;
    EXPECT_THAT(file.error, HasSubstr("--at: found table, expected platform, where the profile "
                                      "'flat' holds"));
    EXPECT_THAT(run(command + "road --config road.toml --at table").error,
                HasSubstr("--at: found table, expected platform, where the profile 'road' holds"));
    for (const char* same : {"flat.json --at platform", "truck --at table", "truck"})
        EXPECT_NE(run(command + same).exit_code, 2) << same;
}

TEST_F(Predict, ASineIsProvenByDwellsAtItsLevel) {
    for (const char* g : {"0.3", "2.5", "3.5"}) {
        write("other.json", R"({"name": "other", "sines": [[55, )" + std::string(g) + "]]}");
        const Ended ended = run(
            "predict result.json --profile other.json --verify held_out.csv --config held.toml");
        EXPECT_EQ(ended.exit_code, 2) << g << ended.out;
        EXPECT_THAT(ended.error,
                    HasSubstr("found no dwell at the profile's frequency and level ("));
    }
    write("other.json", R"({"name": "other", "sines": [[55, 3.1]]})");
    const Ended ended =
        run("predict result.json --profile other.json --verify held_out.csv "
            "--config held.toml --json");
    EXPECT_EQ(ended.exit_code, 0) << ended.error;
    const PredictJson prediction = ended.json()["prediction"];
    for (const auto& dwell : prediction["verification"]["dwells"])
        EXPECT_NEAR(dwell["g_rms"].get<double>(), 3 / std::sqrt(2.0), 0.01);
}

}  // namespace
}  // namespace vibrig::tool
