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
    of["verdict"]["level"] = "2";
    write("moon.json", of.dump());
    EXPECT_THAT(run(command).error, HasSubstr("moon.json: verdict.level: found \"2\", expected 0"));
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
