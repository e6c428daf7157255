#include "daemon/plan/number_table.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "daemon/plan/plan_file.hpp"

namespace vibrig::plan {
namespace {

const TableForm kForm{{"x1", "y"}, {"sigma"}, {"role"}};

NumberTable table_of(const std::string& text) { return read_table(text, "t.csv", kForm); }
std::string refusal_of(const std::string& text) {
    try {
        static_cast<void>(table_of(text));
    } catch (const PlanFileError& error) {
        return error.what();
    }
    return "";
}

TEST(NumberTable, KnowsColumnsWhateverTheirCaseAndTheBlanksAboutThem) {
    const NumberTable table = table_of(" X1,Y\t, \"Sigma\",Remark\n1,2,3,a\n");
    EXPECT_EQ(table.names, (std::vector<std::string>{"x1", "y", "sigma", "Remark"}));
    EXPECT_EQ(table.rows[0][2], 3);
    EXPECT_EQ(refusal_of("x1,X1,y\n"), "t.csv:1: found column x1 twice, expected it once");
}

TEST(NumberTable, RefusesAMisspeltColumnWithTheKnownOnes) {
    EXPECT_EQ(refusal_of("x1,y,Sigmas\n1,2,3\n"),
              "t.csv:1: column Sigmas: found an unknown key, expected a known one, perhaps sigma; "
              "known are x1, y, sigma, role");
    // Beside what it resembles it is somebody's.
    EXPECT_EQ(refusal_of("x1,y,sigma,sigmas\n1,2,3,4\n"), "");
}

TEST(NumberTable, TellsALastLineWithoutAnEnd) {
    EXPECT_EQ(table_of("x1,y\n1,2\n").warning, "");
    EXPECT_EQ(table_of("x1,y\n1,2\n# a remark").warning, "");
    EXPECT_EQ(table_of("x1,y\n1,2\n3,0.01").warning,
              "t.csv:3: found no end of line behind '0.01', expected one: the file may have been "
              "cut, within this field even");
    EXPECT_EQ(refusal_of("x1,y,role\n1,2,verify\n3,4"),
              "t.csv:3: found 2 fields and no end of line, expected 3: the file was cut");
    EXPECT_EQ(refusal_of("x1,y\n1,"),
              "t.csv:2: found nothing in the last field and no end of line, expected both: the "
              "file was cut");
    EXPECT_EQ(refusal_of("x1,y,role\n1,2,"), "") << "which may be empty";
    EXPECT_NE(table_of("x1,y,role\n1,2,").warning, "");
    EXPECT_EQ(refusal_of("x1,y,role\n1,2,\n"), "");
    EXPECT_EQ(refusal_of("x1,y,\n1,2,"), "") << "a comma behind each line";
}

}  // namespace
}  // namespace vibrig::plan
