#include "proto/json_file.hpp"

#include <gtest/gtest.h>

namespace vibrig::proto {
namespace {

std::string refusal_of(const std::string& text) {
    try {
        static_cast<void>(parse_json(text, "a.json", "found no JSON, expected it"));
    } catch (const std::runtime_error& error) {
        return error.what();
    }
    return "";
}

TEST(JsonFile, AKeyThatIsStatedTwiceIsRefused) {
    // Which of the two counts nobody could see.
    EXPECT_EQ(refusal_of(R"({"level_g": 6, "b": [{"c": 1}, {"c": 2}], "level_g": 9})"),
              "a.json: found \"level_g\" twice in one object, expected it once");
    EXPECT_EQ(refusal_of(R"([{"a": {"x\n": 1, "x\n": 1}}])"),
              "a.json: found \"x\\n\" twice in one object, expected it once");
    // What others have beside it or within it is theirs.
    EXPECT_EQ(refusal_of(R"({"a": {"a": 1}, "b": {"a": 1}, "c": [{"a": 1}, {"a": 1}]})"), "");
}

TEST(JsonFile, SaysWhereItIsNone) {
    EXPECT_EQ(refusal_of("{\n \"a\": }"), "a.json: found no JSON, expected it; line 2, column 7");
    EXPECT_EQ(refusal_of("{\"a\": 1"),
              "a.json: found no JSON, expected it; line 1, column 8: the text ends");
    EXPECT_EQ(refusal_of("1e999"),
              "a.json: found no JSON, expected it; a number is beyond all that are known");
    EXPECT_EQ(refusal_of(std::string(100'000, '[')),
              "a.json: found no JSON, expected it; line 1, column 100001: the text ends");
}

}  // namespace
}  // namespace vibrig::proto
