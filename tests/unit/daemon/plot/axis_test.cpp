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

TEST(Axis, OfManyDecadesHasNoZero) {
    Axis axis("det M", true);
    axis.include(1e10);
    axis.include(1e42);
    axis.settle();
    for (const double tick : axis.ticks()) EXPECT_NE(axis.text_of(tick), "0") << tick;
}

TEST(Axis, OfLessThanADecadeHasLabels) {
    // GIVEN data that span a half, two thirds, a little less and more than a decade, anywhere
    for (const double span : {1.01, 2.0, 4.6, 9.9, 10.0, 30.0}) {
        for (double low = 1.1e-5; low < 10; low *= 1.37) {
            Axis axis("deg/h", true);
            axis.include(low);
            axis.include(low * span);
            axis.settle();
            // THEN there are labels to read a value by, within the axis, each once
            const auto ticks = axis.ticks();
            std::set<std::string> labels;
            for (const double tick : ticks) {
                EXPECT_GE(tick, axis.low * 0.999);
                EXPECT_LE(tick, axis.high * 1.001);
                labels.insert(axis.text_of(tick));
            }
            EXPECT_GE(labels.size(), 2U) << low << " to " << low * span;
            EXPECT_EQ(labels.size(), ticks.size());
        }
    }
}

TEST(Axis, WithNamesHasThem) {
    Axis axis("coefficient");
    axis.exact = true;
    axis.include(0.5);
    axis.include(3.5);
    axis.named = {{1, "D_Fx"}, {3, "D_Ox"}};
    axis.settle();
    EXPECT_EQ(axis.ticks(), (std::vector<double>{1, 3}));
    EXPECT_EQ(axis.text_of(3), "D_Ox");
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
