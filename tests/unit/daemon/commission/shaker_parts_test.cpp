#include "daemon/commission/shaker_parts.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vibrig::commission {
namespace {

using ::testing::HasSubstr;

Json proof(const std::string& button, bool with_table, double ratio = 1.01) {
    Json rows = Json::array();
    const auto row = [&rows](const char* name, double value) {
        rows.push_back({{"name", name}, {"value", value}});
    };
    row("controller over command", 1);
    if (with_table) row("table over command", ratio);
    row("platform over command", ratio);
    row("frequency", 15);
    row("stop, controller", 0.2);
    row("watchdog, rest", 1.6);
    if (!button.empty()) row("emergency stop, seen", 0.1);
    return {{"by", "Ada"},
            {"passed", true},
            {"emergency_stop", !button.empty()},
            {"button", button},
            {"message", ""},
            {"table_g", 0.5},
            {"rows", std::move(rows)}};
}

Json at_zero(const std::string& button = "") {
    Json one = proof(button, true);
    one["table_g"] = 0;
    one["rows"] = Json::array({{{"name", "at 0 g, stop"}, {"value", 0.2}},
                               {{"name", "watchdog at 0 g, not fed"}, {"value", 1.5}},
                               {{"name", "emergency stop, seen"}, {"value", 0}}});
    return one;
}

TEST(ShakerParts, ARunAtZeroAndAProofThatShakesAreBothAskedFor) {
    const auto only = shaker_parts({at_zero()}, {"rack"});
    EXPECT_TRUE(only.proven.empty());
    EXPECT_THAT(only.lacking.at(Part::units), HasSubstr("not shaken yet"));
    const auto shaken = shaker_parts({proof("", true)}, {});
    EXPECT_EQ(shaken.lacking.at(Part::watchdog), "it has not run at 0 g");
    EXPECT_EQ(shaken.lacking.at(Part::registers), "it has not run at 0 g");
    // A button that was pressed at 0 g says nothing of the watchdog.
    EXPECT_FALSE(
        shaker_parts({at_zero("rack"), proof("", true)}, {}).proven.contains(Part::watchdog));
    const auto both = shaker_parts({at_zero(), at_zero("rack"), proof("", true)}, {});
    EXPECT_EQ(both.proven.size(), kShakerParts.size());
    EXPECT_EQ(both.proven.at(Part::watchdog)["watchdog at 0 g, not fed"], 1.5);
    EXPECT_EQ(both.proven.at(Part::watchdog)["watchdog, rest"], 1.6);
    EXPECT_EQ(both.proven.at(Part::registers)["at 0 g, stop"], 0.2);
    EXPECT_EQ(both.proven.at(Part::stop)["buttons"]["rack"]["table_g"], 0);
    // AND one that shook and failed is not made good by a later run at 0 g
    Json failed = proof("", true);
    failed["passed"] = false;
    failed["message"] = "no";
    EXPECT_TRUE(shaker_parts({at_zero(), failed, at_zero()}, {}).proven.empty());
}

TEST(ShakerParts, WithoutAProofNoneStands) {
    const auto parts = shaker_parts({}, {"rack"});
    EXPECT_TRUE(parts.proven.empty());
    EXPECT_EQ(parts.lacking.size(), kShakerParts.size());
    EXPECT_EQ(parts.lacking.at(Part::watchdog), "no safe-state proof");
}

TEST(ShakerParts, AProofThatDidNotPassTakesAllOfThem) {
    Json failed = proof("rack", true);
    failed["passed"] = false;
    failed["message"] = "the watchdog was not fed and the table did not stop";
    const auto parts = shaker_parts({proof("rack", true), failed}, {});
    EXPECT_TRUE(parts.proven.empty());
    EXPECT_THAT(parts.lacking.at(Part::stop), HasSubstr("table did not stop"));
}

TEST(ShakerParts, EachButtonIsPressed) {
    EXPECT_EQ(shaker_parts({proof("rack", true)}, {"door"}).lacking.at(Part::stop),
              "not pressed yet: \"door\"");
    const auto parts = shaker_parts({at_zero(), proof("rack", true), proof("door", true)}, {});
    EXPECT_EQ(parts.proven.size(), kShakerParts.size());
    EXPECT_EQ(parts.proven.at(Part::stop)["buttons"]["rack"]["emergency stop, seen"], 0.1);
}

TEST(ShakerParts, WithoutAnAccelerometerAtTheTableTheUnitIsNotBelieved) {
    const std::vector<Json> proofs{proof("", false)};
    EXPECT_THAT(shaker_parts(proofs, {}).lacking.at(Part::units),
                HasSubstr("g peak or g rms, ln odds"));
    EXPECT_TRUE(shaker_parts(proofs, {}, {"g peak", 0.49}).proven.contains(Part::units));
    EXPECT_EQ(shaker_parts(proofs, {}, {"g rms", 0.49}).lacking.at(Part::units),
              "the display shows g rms, the reference g peak");
    EXPECT_THAT(shaker_parts(proofs, {}, {"g rms", 0.70}).lacking.at(Part::units),
                HasSubstr("counts in g rms, expected g peak"));
}

}  // namespace
}  // namespace vibrig::commission
