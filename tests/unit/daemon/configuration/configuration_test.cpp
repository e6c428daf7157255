#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/unit/daemon/configuration/support.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::configuration {
namespace {

using ::testing::HasSubstr;

class Files : public ::testing::Test {
  protected:
    std::string complaint_of(const std::filesystem::path& path) {
        try {
            static_cast<void>(load(path.string(), false));
        } catch (const ConfigurationError& error) {
            return error.what();
        }
        return "";
    }
    TemporaryFolder folder_;
};

TEST_F(Files, AreReadAndNamedAsGiven) {
    const auto path = folder_ / "rig.toml";
    std::ofstream(path) << "[site]\nlatitude_deg = 10\n[commission]\nsimulated = true\n";
    const Loaded loaded = load(path.string(), true);
    EXPECT_EQ(loaded.configuration.estimator.latitude_deg, 10);
    EXPECT_EQ(loaded.effective.front().origin, path.string() + ":2");
}

TEST_F(Files, ThatCannotBeReadSayWhy) {
    EXPECT_THAT(complaint_of(folder_ / "none.toml"), HasSubstr("No such file"));
    EXPECT_THAT(complaint_of(folder_), HasSubstr("found a folder"));
    EXPECT_THAT(complaint_of("/dev/zero"), HasSubstr("more than"));
}

TEST_F(Files, NoPathMeansAllDefaults) {
    EXPECT_EQ(load("", false).configuration.estimator.latitude_deg, 45.75);
}

}  // namespace
}  // namespace vibrig::configuration
