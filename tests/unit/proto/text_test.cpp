#include "proto/text.hpp"

#include <gtest/gtest.h>

#include <random>

namespace vibrig::proto {
namespace {

std::string line(std::string_view text) { return printable(text, kLongestLine); }

TEST(Printable, KeepsWhatIsReadable) {
    const std::string plain =
        "refused arm by J\xC3\xBCrgen (uid 1000): 20 \xE2\x82\xAC \xF0\x9F\x98\x80";
    EXPECT_EQ(line(plain), plain);
    EXPECT_EQ(line(""), "");
}

TEST(Printable, EscapesWhatMakesLinesAndCommandsOfATerminal) {
    EXPECT_EQ(line("a\nb\r\tc"), "a\\nb\\r\\tc");
    EXPECT_EQ(line("\x1B[31mred"), "\\x1b[31mred");
    EXPECT_EQ(line(std::string_view("\0\x7F", 2)), "\\x00\\x7f");
    EXPECT_EQ(line("\xC2\x9B\x33m"), "\\u009b3m");  // CSI in one character
    EXPECT_EQ(line("\xE2\x80\xA8"), "\\u2028");     // line separator
    EXPECT_EQ(line("a\xE2\x80\xAE"
                   "b"),
              "a\\u202eb");  // writes backwards
    EXPECT_EQ(line("a\xFF\xC3"), "a\\xff\\xc3");
}

TEST(Printable, IsBoundedAtAWholeCharacter) {
    EXPECT_EQ(line(std::string(kLongestLine, 'a')), std::string(kLongestLine, 'a'));
    EXPECT_EQ(line(std::string(kLongestLine + 1, 'a')), std::string(kLongestLine, 'a') + "...");
    EXPECT_EQ(line(std::string(kLongestLine - 1, 'a') + "\xC3\xBC"),
              std::string(kLongestLine - 1, 'a') + "...");
    EXPECT_EQ(line(std::string(kLongestLine - 1, 'a') + "\n"),
              std::string(kLongestLine - 1, 'a') + "...");
}

TEST(Printable, OfAnythingIsCleanAndStaysAsItIs) {
    constexpr unsigned kSeed = 20090402;
    std::mt19937 random(kSeed);
    for (int round = 0; round < 500; ++round) {
        std::string bytes(random() % 1500, '\0');
        for (char& c : bytes) c = static_cast<char>(random());
        const std::string shown = line(bytes);
        EXPECT_LE(shown.size(), kLongestLine + 3);
        EXPECT_TRUE(is_utf8(shown)) << "seed " << kSeed;
        for (const char c : shown) EXPECT_TRUE(static_cast<unsigned char>(c) >= 0x20 && c != 0x7F);
        if (shown.size() > kLongestLine) continue;
        EXPECT_EQ(line(shown), shown) << "seed " << kSeed;
    }
}

TEST(MendUtf8, HasAMarkForEachByteThatIsNone) {
    const std::string good = "caf\xC3\xA9 \xE2\x82\xAC \xF0\x9F\x98\x80\n\t";
    EXPECT_EQ(mend_utf8(good), good);
    EXPECT_EQ(mend_utf8(""), "");
    EXPECT_EQ(mend_utf8("\xFF"), "?");
    EXPECT_EQ(mend_utf8("a\xC3"), "a?");               // cut off
    EXPECT_EQ(mend_utf8("\xC0\xAF"), "??");            // overlong
    EXPECT_EQ(mend_utf8("\xED\xA0\x80"), "???");       // surrogate
    EXPECT_EQ(mend_utf8("\xF4\x90\x80\x80"), "????");  // beyond U+10FFFF
}

}  // namespace
}  // namespace vibrig::proto
