#include "daemon/serve/one_line.hpp"

#include <gtest/gtest.h>

#include <random>

#include "daemon/serve/status_message.hpp"

namespace vibrig::serve {
namespace {

TEST(OneLine, KeepsWhatIsReadable) {
    const std::string plain =
        "refused arm by J\xC3\xBCrgen (uid 1000): 20 \xE2\x82\xAC \xF0\x9F\x98\x80";
    EXPECT_EQ(one_line(plain), plain);
    EXPECT_EQ(one_line(""), "");
}

TEST(OneLine, EscapesWhatMakesLinesAndCommandsOfATerminal) {
    EXPECT_EQ(one_line("a\nb\r\tc"), "a\\nb\\r\\tc");
    EXPECT_EQ(one_line("\x1B[31mred"), "\\x1b[31mred");
    EXPECT_EQ(one_line(std::string_view("\0\x7F", 2)), "\\x00\\x7f");
    EXPECT_EQ(one_line("\xC2\x9B\x33m"), "\\u009b3m");  // CSI in one character
    EXPECT_EQ(one_line("\xE2\x80\xA8"), "\\u2028");     // line separator
    EXPECT_EQ(one_line("a\xE2\x80\xAE"
                       "b"),
              "a\\u202eb");  // writes backwards
    EXPECT_EQ(one_line("a\xFF\xC3"), "a??");
}

TEST(OneLine, IsBoundedAtAWholeCharacter) {
    EXPECT_EQ(one_line(std::string(kLongestLine, 'a')), std::string(kLongestLine, 'a'));
    EXPECT_EQ(one_line(std::string(kLongestLine + 1, 'a')), std::string(kLongestLine, 'a') + "...");
    EXPECT_EQ(one_line(std::string(kLongestLine - 1, 'a') + "\xC3\xBC"),
              std::string(kLongestLine - 1, 'a') + "...");
    EXPECT_EQ(one_line(std::string(kLongestLine - 1, 'a') + "\n"),
              std::string(kLongestLine - 1, 'a') + "...");
}

TEST(OneLine, OfAnythingIsCleanAndStaysAsItIs) {
    constexpr unsigned kSeed = 20090402;
    std::mt19937 random(kSeed);
    for (int round = 0; round < 500; ++round) {
        std::string bytes(random() % 1500, '\0');
        for (char& c : bytes) c = static_cast<char>(random());
        const std::string line = one_line(bytes);
        EXPECT_LE(line.size(), kLongestLine + 3);
        EXPECT_EQ(mend_utf8(line), line) << "seed " << kSeed;
        for (const char c : line) EXPECT_TRUE(static_cast<unsigned char>(c) >= 0x20 && c != 0x7F);
        if (line.size() > kLongestLine) continue;
        EXPECT_EQ(one_line(line), line) << "seed " << kSeed;
    }
}

}  // namespace
}  // namespace vibrig::serve
