#include "daemon/plan/plan_file.hpp"

#include <gtest/gtest.h>

#include <fstream>

#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::plan {
namespace {

TEST(PlanFile, ALevelThatIsStatedTwiceIsRefused) {
    // GIVEN a run of 2 g, behind which somebody has written 6 g
    const TemporaryFolder folder;
    const std::string path = folder.file("plan.json");
    std::ofstream(path) << R"({"runs": [{"position": [0, 0, 0], "level_g": 2, "level_g": 6}]})";
    // THEN it is named: the last of them would have shaken
    try {
        static_cast<void>(read_plan_file(path, [](auto) { return 0.6667; }));
        FAIL() << "accepted";
    } catch (const PlanFileError& error) {
        EXPECT_EQ(error.what(), path + ": found \"level_g\" twice in one object, expected it once");
    }
}

}  // namespace
}  // namespace vibrig::plan
