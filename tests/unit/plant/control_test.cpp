#include "tests/plant/control.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <string>

#include "tests/plant/shared_rig.hpp"

namespace vibrig::plant {
namespace {

TEST(Control, ExecutesLinesAndComplains) {
    SharedRig shared{Truth{}};
    Control control(shared);
    EXPECT_EQ(control.execute("fault lose=0.5"), "ok fault lose=0.5");
    EXPECT_NE(shared.faults.active(FaultKind::lose, 0), nullptr);
    EXPECT_EQ(control.execute("  clear lose\r"), "ok clear lose");
    EXPECT_EQ(shared.faults.active(FaultKind::lose, 0), nullptr);
    EXPECT_EQ(control.execute("table 2.5"), "ok table 2.5");
    EXPECT_EQ(shared.rig.shaker().amplitude_g(), 2.5);
    EXPECT_EQ(control.execute("table own"), "ok table own");
    EXPECT_EQ(shared.rig.shaker().amplitude_g(), 0);
    EXPECT_EQ(control.execute("estop open"), "ok estop open");
    EXPECT_TRUE(shared.emergency_stop_by_hand);
    EXPECT_EQ(control.execute("status").substr(0, 7), "ok time");
    for (const char* line :
         {"", "estop", "fault", "fault nonsense", "clear everything", "quit now", "table",
          "table -1", "table nan", "table 2 g", "speed 0", "speed 1e-9"}) {
        EXPECT_EQ(control.execute(line).substr(0, 6), "error:") << line;
    }
}

TEST(Control, SaysThatALineIsTooLong) {
    // GIVEN more than a line may have, without an end
    SharedRig shared{Truth{}};
    Control control(shared);
    std::array<int, 2> ends{};
    ASSERT_EQ(pipe(ends.data()), 0);
    testing::internal::CaptureStdout();
    const std::string part(1000, 'x');
    for (int i = 0; i < 5; ++i) {
        ASSERT_EQ(write(ends[1], part.data(), part.size()), 1000);
        ASSERT_TRUE(control.read(ends[0]));
    }
    // THEN it is left out, which is said
    EXPECT_EQ(testing::internal::GetCapturedStdout(),
              "error: found a line of more than 4096 bytes, expected fault SPEC, "
              "clear [NAME], estop open, estop close, table G, table own, hold S, go, "
              "speed F, speed max, status, help\n");
    close(ends[0]);
    close(ends[1]);
}

}  // namespace
}  // namespace vibrig::plant
