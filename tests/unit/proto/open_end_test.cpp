#include "proto/open_end.hpp"

#include <gtest/gtest.h>

namespace vibrig::proto {
namespace {

TEST(OpenEnd, IsToldOnceForEachPlace) {
    const std::string words =
        "a.csv:7: found no end of line behind '0.01', expected one: the file may have been cut, "
        "within this field even";
    testing::internal::CaptureStderr();
    EXPECT_EQ(tell_open_end("a.csv:7", "0.01"), words);
    EXPECT_EQ(tell_open_end("a.csv:7", "0.01"), words);
    static_cast<void>(tell_open_end("b.csv:7", "x"));
    const std::string told = testing::internal::GetCapturedStderr();
    EXPECT_EQ(told.find("warning: " + words + "\nwarning: b.csv:7: found"), 0U) << told;
}

TEST(OpenEnd, FieldsThatAreNotThereAreCutOff) {
    EXPECT_EQ(cut_fields(2, 3, "1", true),
              "found 2 fields and no end of line, expected 3: the file was cut");
    EXPECT_NE(cut_fields(3, 3, "", true), "");
    EXPECT_EQ(cut_fields(3, 3, "", false), "") << "a column that nobody reads";
    EXPECT_EQ(cut_fields(3, 3, "1", true), "");
    EXPECT_EQ(cut_fields(4, 3, "", false), "") << "a comma behind each line";
}

}  // namespace
}  // namespace vibrig::proto
