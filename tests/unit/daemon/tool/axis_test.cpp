#include <gtest/gtest.h>

#include <set>
#include <string>

#include "daemon/plot/axis.hpp"

namespace vibrig::tool::plot {
namespace {

TEST(Axis, LabelsTellOneTickFromTheNext) {
    for (const double width : {10.0, 1e-2, 1e-5, 3e-7, 1e-9}) {
        SCOPED_TRACE(width);
        Axis axis("Hz");
        axis.include(15);
        axis.include(15 + width);
        axis.settle();
        const auto ticks = axis.ticks();
        ASSERT_GE(ticks.size(), 4U);
        std::set<std::string> labels;
        for (const double tick : ticks) {
            labels.insert(axis.text_of(tick));
            EXPECT_NEAR(std::stod(axis.text_of(tick)), tick, 0.1 * (ticks[1] - ticks[0]));
        }
        EXPECT_EQ(labels.size(), ticks.size());
    }
    Axis plain("g");
    plain.include(-0.1);
    plain.include(0.7);
    plain.settle();
    EXPECT_EQ(plain.text_of(plain.ticks()[1]), "0");
    EXPECT_EQ(plain.text_of(plain.ticks().back()), "0.7");
}

TEST(Axis, ThatIsExactKeepsItsRange) {
    Axis axis("coefficient");
    axis.exact = true;
    axis.include(0.5);
    axis.include(30.5);
    axis.settle();
    EXPECT_EQ(axis.low, 0.5);
    EXPECT_EQ(axis.high, 30.5);
    EXPECT_EQ(axis.ticks(), (std::vector<double>{5, 10, 15, 20, 25, 30}));
}

}  // namespace
}  // namespace vibrig::tool::plot
