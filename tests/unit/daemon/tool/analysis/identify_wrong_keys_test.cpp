// A recording that is identified with one wrong key: `vibrig identify` says so and names it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>

#include "tests/unit/support/temporary_folder.hpp"

namespace {

using ::testing::HasSubstr;
using ::testing::Not;

struct WrongKey {
    const char* name;
    const char* configuration;
    const char* named;
};

class WrongKeys : public ::testing::TestWithParam<WrongKey> {
  protected:
    static void SetUpTestSuite() {
        folder_.emplace();
        ASSERT_EQ(run(std::string(VIBRIG_PLANT) + " record --seed 5 --dwell 20 -o rec.csv"), 0);
    }
    static void TearDownTestSuite() { folder_.reset(); }

    static int run(const std::string& command) {
        const int status =
            std::system(("cd '" + folder_->string() + "' && " + command + " >out 2>error").c_str());
        return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    }
    static std::string content(const char* name) {
        std::ostringstream text;
        text << std::ifstream(*folder_ / name).rdbuf();
        return text.str();
    }
    /// Exit code and all warnings of an identification.
    static std::pair<int, std::string> identify(const std::string& configuration) {
        std::ofstream(*folder_ / "rig.toml") << configuration;
        const int code = run(std::string(VIBRIG) + " identify rec.csv --config rig.toml --json");
        std::string warnings;
        const auto result = nlohmann::json::parse(content("out"));
        for (const auto& warning : result.at("warnings"))
            warnings += warning.get<std::string>() + "\n";
        return {code, warnings};
    }

    static inline std::optional<vibrig::TemporaryFolder> folder_;
};

TEST_P(WrongKeys, AreSuspectedAndTheExitCodeSaysNo) {
    const auto [code, warnings] = identify(GetParam().configuration);
    EXPECT_EQ(code, 1);
    EXPECT_THAT(warnings, HasSubstr(std::string("suspects, best first: ")));
    EXPECT_THAT(warnings, HasSubstr(GetParam().named));
}

INSTANTIATE_TEST_SUITE_P(
    Each, WrongKeys,
    ::testing::Values(WrongKey{"InnerSign", "platform.encoder_sign = [1, -1, 1]",
                               "platform.encoder_sign: 1 instead of -1 of the inner"},
                      WrongKey{"OuterSign", "platform.encoder_sign = [-1, 1, 1]",
                               "platform.encoder_sign: 1 instead of -1 of the outer"},
                      WrongKey{"AzimuthSign", "platform.encoder_sign = [1, 1, -1]",
                               "platform.encoder_sign: 1 instead of -1 of the azimuth"},
                      WrongKey{"OuterZero", "platform.encoder_zero_deg = [5, 0, 0]",
                               "instead of 5 of the outer gimbal"},
                      WrongKey{"InnerZero", "platform.encoder_zero_deg = [0, 5, 0]",
                               "instead of 5 of the inner gimbal"},
                      WrongKey{"AzimuthZero", "platform.encoder_zero_deg = [0, 0, 5]",
                               "instead of 5 of the azimuth gimbal"},
                      WrongKey{"Swapped",
                               "accelerometer.matrix = [[0, 1, 0], [1, 0, 0], [0, 0, 1]]",
                               "accelerometer.matrix: x, y, z are +y, +x, +z"},
                      WrongKey{"Inverted",
                               "accelerometer.matrix = [[-1, 0, 0], [0, -1, 0], [0, 0, -1]]",
                               "accelerometer.matrix: x, y, z are -x, -y, -z"},
                      WrongKey{"LatitudeSign", "site.latitude_deg = -45.75",
                               "site.latitude_deg: 45.75 instead of -45.75"},
                      WrongKey{"Azimuth", "site.azimuth_deg = 90", "site.azimuth_deg: "},
                      WrongKey{"Elevation", "site.elevation_deg = 1.5", "site.elevation_deg: 0.0"}),
    [](const auto& wrong) { return std::string(wrong.param.name); });

class RightKeys : public WrongKeys {
  protected:
    /// Of the recording with another unit of time.
    static std::pair<int, std::string> identify_with_time_times(const std::string& factor) {
        EXPECT_EQ(
            run("awk -F, 'BEGIN{OFS=\",\"} NR==1{for(i=1;i<=NF;++i) if($i==\"time_s\") t=i} "
                "NR>1{$t=sprintf(\"%.12g\",$t*(" +
                factor + "))} {print}' rec.csv > m.csv && mv rec.csv s.csv && mv m.csv rec.csv; :"),
            0);
        auto found = identify("");
        std::filesystem::rename(*folder_ / "s.csv", *folder_ / "rec.csv");
        return found;
    }
};

TEST_F(RightKeys, RaiseNoDoubt) {
    const auto [code, warnings] = identify("");
    EXPECT_EQ(code, 0) << warnings;
    EXPECT_THAT(warnings, Not(HasSubstr("do not fit")));
}

TEST_F(RightKeys, ButTwoGyrosOnOneAxisAreReported) {
    EXPECT_THAT(identify("platform.gyro_y_axes = [\"+x\", \"+y\", \"+z\"]").second,
                HasSubstr("platform.gyro_y_axes[0]: found \"+x\", the input axis of gyro x too"));
}

TEST_F(RightKeys, ButVibrationAlongTheVerticalOnlyWantsTheRestDeclared) {
    const std::string vertical = "platform.second_moment = \"vertical\"\n";
    EXPECT_THAT(identify(vertical).second,
                HasSubstr("platform.second_moment: found \"vertical\" without"));
    EXPECT_THAT(identify(vertical + "uncertainty.cross_axis = 0.01").second,
                Not(HasSubstr("second_moment")));
}

TEST_F(RightKeys, ButTimeInMinutesIsSuspected) {
    const auto [code, warnings] = identify_with_time_times("1/60");
    EXPECT_EQ(code, 1);
    EXPECT_THAT(warnings, HasSubstr("time_s: it is in minutes"));
}

TEST_F(RightKeys, ButTimeInMillisecondsIsAskedAbout) {
    EXPECT_EQ(identify_with_time_times("1000").first, 1);
    EXPECT_THAT(content("error"), HasSubstr("time_s: found 25 s from one sample to the next"));
}

}  // namespace
