#include "proto/person_name.hpp"

#include <gtest/gtest.h>

namespace vibrig::proto {
namespace {

TEST(PersonName, IsWhatOneReadsAloud) {
    EXPECT_EQ(plain_name("  Ada \t Lovelace (uid 1000, peer 7)"), "ada lovelace");
    EXPECT_EQ(plain_name("\u00c9mile du Ch\u00e2telet"), "\u00c9mile du ch\u00e2telet");
    EXPECT_TRUE(same_person("Ada", "ada (uid 0)"));
    EXPECT_FALSE(same_person("Ada", "Adam"));
}

TEST(PersonName, OfWhatCannotBeSeenIsNobodys) {
    // No-break, thin, ideographic; of no width, a byte order mark, a Hangul filler
    for (const char* text :
         {"", "  ", "\u00a0", "\u2009\u3000", "\u200b", "\ufeff", "\u3164", " \u2060 "})
        EXPECT_EQ(plain_name(text), "") << text;
}

TEST(PersonName, DoesNotMakeTwoPersonsOfOne) {
    for (const char* text : {"Ada\u00a0Lovelace", "Ada\u200b Lovelace", "\ufeffAda Lovelace",
                             "Ada\u2003 Love\u00adlace"})
        EXPECT_TRUE(same_person(text, "Ada Lovelace")) << text;
}

TEST(PersonName, OfBytesThatAreNoTextIsKept) {
    // Cut off, and a lead without what follows it
    EXPECT_EQ(plain_name("ada\xe2\x80"), "ada\xe2\x80");
    EXPECT_EQ(plain_name("\xf0"
                         "ada"),
              "\xf0"
              "ada");
    EXPECT_FALSE(same_person("ada\xff", "ada"));
}

}  // namespace
}  // namespace vibrig::proto
