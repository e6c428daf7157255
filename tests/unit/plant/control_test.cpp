#include "tests/plant/control.hpp"

#include <gtest/gtest.h>

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
    for (const char* line : {"", "estop", "fault", "fault nonsense", "clear everything", "quit now",
                             "table", "table -1", "table nan", "table 2 g"}) {
        EXPECT_EQ(control.execute(line).substr(0, 6), "error:") << line;
    }
}

}  // namespace
}  // namespace vibrig::plant
