#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

#include "daemon/serve/status_json.hpp"

namespace vibrig::serve {
namespace {

std::string error_of(const std::string& json) {
    try {
        (void)parse_command(json);
    } catch (const std::invalid_argument& error) {
        return error.what();
    }
    return "none";
}

TEST(Command, IsReadWithAllItsFields) {
    const CommandRequest request =
        parse_command(R"({"kind":"acknowledge","by":"Ada","argument":"trip"})");
    EXPECT_EQ(request.kind, CommandRequest::Kind::acknowledge);
    EXPECT_EQ(request.by, "Ada");
    EXPECT_EQ(request.argument, "trip");
    EXPECT_EQ(parse_command(R"({"kind":"arm","by":"Ada"})").kind, CommandRequest::Kind::arm);
    EXPECT_EQ(parse_command(R"({"kind":"start","by":"Ada"})").kind, CommandRequest::Kind::start);
    EXPECT_EQ(parse_command(R"({"kind":"pause","by":"Ada"})").kind, CommandRequest::Kind::pause);
    EXPECT_EQ(parse_command(R"({"kind":"resume","by":"Ada"})").kind, CommandRequest::Kind::resume);
    EXPECT_EQ(parse_command(R"({"kind":"abort","by":"Ada"})").kind, CommandRequest::Kind::abort);
}

/// As `vibrig abort` takes any name: the table shakes while somebody reads an error.
TEST(Command, AStopIsTakenWhateverIsBesideIt) {
    for (const std::string& json :
         {std::string(R"({"kind":"abort"})"), std::string(R"({"kind":"abort","by":"  "})"),
          std::string(R"({"kind":"abort","by":"A\nfaked line"})"),
          std::string(R"({"kind":"abort","by":"A","why":{"smoke":true}})"),
          R"({"kind":"abort","by":")" + std::string(3000, 'x') + "\"}",
          R"({"kind":"abort","by":"A","argument":")" + std::string(3000, 'x') + "\"}"}) {
        const CommandRequest request = parse_command(json);
        EXPECT_EQ(request.kind, CommandRequest::Kind::abort) << json;
        EXPECT_FALSE(request.by.empty()) << json;
        EXPECT_LT(request.by.size() + request.argument.size(), 310U) << json;
        EXPECT_EQ(request.by.find('\n'), std::string::npos) << json;
    }
    EXPECT_EQ(parse_command(R"({"kind":"abort"})").by, "somebody");
    // What is no command is no stop either, and which of two it is nobody knows.
    EXPECT_NE(error_of(R"({"kind":"abort","by":3})"), "none");
    EXPECT_NE(error_of(R"({"kind":"start","by":"A","why":"x"})").find("why"), std::string::npos);
}

TEST(Command, IsRefusedWithTheFieldAndWhatWasExpected) {
    EXPECT_NE(error_of(""), "none");
    EXPECT_NE(error_of("not json").find("not a Command in JSON"), std::string::npos);
    EXPECT_NE(error_of("{}").find("kind: missing or unknown"), std::string::npos);
    EXPECT_NE(error_of(R"({"kind":"unspecified","by":"A"})").find("kind:"), std::string::npos);
    EXPECT_NE(error_of(R"({"kind":"explode","by":"A"})").find("explode"), std::string::npos);
    EXPECT_NE(error_of(R"({"kind":99,"by":"A"})").find("kind"), std::string::npos);
    EXPECT_NE(error_of(R"({"kind":"arm"})").find("by: empty"), std::string::npos);
    EXPECT_NE(error_of(R"({"kind":"arm","by":"   "})").find("by: empty"), std::string::npos);
    // A no-break space, and one of no width
    EXPECT_NE(error_of(R"({"kind":"arm","by":"\u00a0\u200b"})").find("by: empty"),
              std::string::npos);
    EXPECT_NE(error_of(R"({"kind":"arm","by":"A\nfaked line"})").find("control character"),
              std::string::npos);
    // What is one line is taken up to its own limit, which is beyond that of a log's line.
    const std::string dots(3000, '.');
    const auto script = [&dots](const char* more) {
        return R"({"kind":"commission","by":"A","argument":")" + dots + more + "\"}";
    };
    EXPECT_EQ(parse_command(script("")).argument.size(), dots.size());
    EXPECT_NE(error_of(script("\\n")).find("control character"), std::string::npos);
    for (const char* c : {"\\u001b", "\\u009b", "\\u2028", "\\u202e"})
        EXPECT_NE(error_of(std::string(R"({"kind":"arm","by":"A)") + c + "\"}").find("control"),
                  std::string::npos)
            << c;
    EXPECT_NE(
        error_of(R"({"kind":"arm","by":")" + std::string(101, 'x') + "\"}").find("by: 101 bytes"),
        std::string::npos);
    EXPECT_NE(error_of(R"({"kind":"arm","by":"A","force":true})").find("force"), std::string::npos);
    EXPECT_NE(error_of(R"({"kind":"acknowledge","by":"A"})").find("argument: empty"),
              std::string::npos);
    for (const char* twice : {R"({"kind":"abort","kind":"arm","by":"A"})",
                              R"({"by":"A","kind":"arm","k\u0069nd":"arm"})",
                              R"({"kind":"arm","kind":"arm","by":"A"})"})
        EXPECT_NE(error_of(twice).find("\"kind\" twice"), std::string::npos) << twice;
    EXPECT_NE(error_of(R"({"kind":"arm","by":"A","by":"B"})").find("\"by\" twice"),
              std::string::npos);
    EXPECT_NE(error_of(R"({kind:"arm","by":"A"})").find("at byte 2"), std::string::npos);
    EXPECT_NE(error_of(R"({"kind":1e999,"by":"A"})").find("out of range"), std::string::npos);
    EXPECT_NE(error_of("[]"), "none");
    EXPECT_NE(error_of("null"), "none");
    EXPECT_NE(error_of(std::string(10'000, '[')), "none");
}

}  // namespace
}  // namespace vibrig::serve
