#include <gtest/gtest.h>

#include <cstdlib>
#include <random>

#include "proto/dbc.hpp"

namespace vibrig::proto {
namespace {

std::string error_in_dbc(const std::string& text) {
    try {
        (void)parse_dbc(text, "f.dbc");
    } catch (const DbcError& failure) {
        return failure.what();
    }
    return "no error";
}

/// The error for a message of 8 bytes with these lines of signals and statements after it.
std::string in_message(const std::string& lines) {
    return error_in_dbc("BO_ 5 Msg: 8 Box\n" + lines);
}

TEST(DbcErrors, NameLineColumnWhatWasFoundAndWhatWasExpected) {
    try {
        (void)parse_dbc("BO_ 5 Msg: 8 Box\n SG_ A : 0|8@1+ (1;0) [0|0] \"\" X\n", "f.dbc");
        FAIL() << "no error";
    } catch (const DbcError& failure) {
        EXPECT_STREQ(failure.what(), "f.dbc:2:19: found ';', expected ','");
        EXPECT_EQ(failure.line(), 2);
        EXPECT_EQ(failure.column(), 19);
    }
}

TEST(DbcErrors, NameWhatIsNoDbc) {
    EXPECT_EQ(error_in_dbc(""),
              "f.dbc:1:1: found end of file, expected a DBC statement such as VERSION, BU_ or BO_");
    EXPECT_EQ(error_in_dbc("\n \n"),
              "f.dbc:3:1: found end of file, expected a DBC statement such as VERSION, BU_ or BO_");
    EXPECT_EQ(error_in_dbc("{\"a\": 1}"),
              "f.dbc:1:1: found '{', expected a DBC statement such as BO_, SG_, CM_ or VAL_");
    EXPECT_EQ(error_in_dbc("BOO_ 5 Msg: 8 Box"),
              "f.dbc:1:1: found 'BOO_', expected a DBC statement such as BO_, SG_, CM_ or VAL_");
    EXPECT_EQ(error_in_dbc(std::string("\0\x01", 2)),
              "f.dbc:1:1: found '\\x00', expected a DBC statement such as BO_, SG_, CM_ or VAL_");
    EXPECT_EQ(error_in_dbc(" SG_ A : 0|8@1+ (1,0) [0|0] \"\" X"),
              "f.dbc:1:2: found 'SG_', expected a message (BO_) before its signals");
}

TEST(DbcErrors, NameTruncatedFiles) {
    EXPECT_EQ(error_in_dbc("BO_ 5 Msg: 8"),
              "f.dbc:1:13: found end of file, expected the sending node");
    EXPECT_EQ(error_in_dbc("VERSION \"1"),
              "f.dbc:1:9: found a string that never ends, expected its closing '\"'");
    EXPECT_EQ(error_in_dbc("CM_ \"a text\"\nBO_ 5 Msg: 8 Box\n"),
              "f.dbc:2:1: found 'BO_', expected the ';' that ends the statement before");
    EXPECT_EQ(error_in_dbc("CM_ \"a text\"\n"),
              "f.dbc:2:1: found end of file, expected the ';' that ends the statement before");
    EXPECT_EQ(in_message(" SG_ A : 0|8@1+ (1,0) [0|0]"),
              "f.dbc:2:28: found end of file, expected the unit as a string");
}

TEST(DbcErrors, NameMessagesThatCannotBe) {
    EXPECT_EQ(error_in_dbc("BO_ -5 Msg: 8 Box"), "f.dbc:1:5: found '-', expected a message id");
    EXPECT_EQ(error_in_dbc("BO_ 99999999999999999999 Msg: 8 Box"),
              "f.dbc:1:5: found '99999999999999999999', expected a message id");
    EXPECT_EQ(error_in_dbc("BO_ 2048 Msg: 8 Box"),
              "f.dbc:1:5: found '2048', expected a standard id up to 2047, or bit 31 set for an "
              "extended id");
    EXPECT_EQ(
        error_in_dbc("BO_ 3758096384 Msg: 8 Box"),
        "f.dbc:1:5: found '3758096384', expected an extended id up to 0x1FFFFFFF (plus bit 31)");
    EXPECT_EQ(error_in_dbc("BO_ 5 Msg: 65 Box"),
              "f.dbc:1:12: found '65', expected a size of 0 to 64 bytes");
    EXPECT_EQ(error_in_dbc("BO_ 5 Msg: 8 Box\nBO_ 5 Other: 8 Box"),
              "f.dbc:2:5: found '5', expected an id that no other message has");
    EXPECT_EQ(error_in_dbc("BO_ 5 Msg: 8 Box\nBO_ 6 Msg: 8 Box"),
              "f.dbc:2:7: found 'Msg', expected a name that no other message has");
    EXPECT_EQ(error_in_dbc("BO_ 5 Msg: 8 Box\nBO_ 2147483653 Ext: 8 Box"), "no error");
}

TEST(DbcErrors, NameSignalsThatDoNotFit) {
    const std::string range =
        "' with bits outside the 8 bytes of message 'Msg', expected it inside";
    EXPECT_EQ(in_message(" SG_ A : 57|8@1+ (1,0) [0|0] \"\" X"),
              "f.dbc:2:10: found signal 'A" + range);
    EXPECT_EQ(in_message(" SG_ A : 56|9@0+ (1,0) [0|0] \"\" X"),
              "f.dbc:2:10: found signal 'A" + range);
    EXPECT_EQ(in_message(" SG_ A : 64|1@1+ (1,0) [0|0] \"\" X"),
              "f.dbc:2:10: found signal 'A" + range);
    EXPECT_EQ(in_message(" SG_ A : 511|64@0+ (1,0) [0|0] \"\" X"),
              "f.dbc:2:10: found signal 'A" + range);
    EXPECT_EQ(in_message(" SG_ A : 512|1@1+ (1,0) [0|0] \"\" X"),
              "f.dbc:2:10: found '512', expected a start bit of 0 to 511");
    EXPECT_EQ(in_message(" SG_ A : 0|0@1+ (1,0) [0|0] \"\" X"),
              "f.dbc:2:12: found '0', expected a length of 1 to 64 bits");
    EXPECT_EQ(in_message(" SG_ A : 0|65@1+ (1,0) [0|0] \"\" X"),
              "f.dbc:2:12: found '65', expected a length of 1 to 64 bits");
    EXPECT_EQ(in_message(" SG_ A : 0|8@2+ (1,0) [0|0] \"\" X"),
              "f.dbc:2:14: found '2', expected byte order 0 (big endian) or 1 (little endian)");
    EXPECT_EQ(in_message(" SG_ A : 0|8@1* (1,0) [0|0] \"\" X"),
              "f.dbc:2:15: found '*', expected '+' (unsigned) or '-' (signed)");
    EXPECT_EQ(in_message(" SG_ A : 7|64@0+ (1,0) [0|0] \"\" X"), "no error");
}

TEST(DbcErrors, NameNumbersThatAreNone) {
    EXPECT_EQ(in_message(" SG_ A : 0|8@1+ (0,0) [0|0] \"\" X"),
              "f.dbc:2:18: found '0', expected a scale other than 0");
    EXPECT_EQ(in_message(" SG_ A : 0|8@1+ (nan,0) [0|0] \"\" X"),
              "f.dbc:2:18: found 'nan', expected the scale, a finite number");
    EXPECT_EQ(in_message(" SG_ A : 0|8@1+ (1,-inf) [0|0] \"\" X"),
              "f.dbc:2:21: found 'inf', expected the offset, a finite number");
    EXPECT_EQ(in_message(" SG_ A : 0|8@1+ (1,1.#INF) [0|0] \"\" X"),
              "f.dbc:2:20: found '1.#INF', expected the offset, a finite number");
    EXPECT_EQ(in_message(" SG_ A : 0|8@1+ (1e999,0) [0|0] \"\" X"),
              "f.dbc:2:18: found '1e999', expected the scale, a finite number");
    EXPECT_EQ(in_message(" SG_ A : 0|8@1+ (1.2.3,0) [0|0] \"\" X"),
              "f.dbc:2:18: found '1.2.3', expected the scale, a finite number");
    EXPECT_EQ(in_message(" SG_ A : 0|8@1+ (1,0) [1|0] \"\" X"),
              "f.dbc:2:24: found '1', expected a minimum that is not above the maximum");
    EXPECT_EQ(in_message(" SG_ A : 0|8@1+ (0x1,0) [0|0] \"\" X"),
              "f.dbc:2:18: found '0x1', expected the scale, a finite number");
    EXPECT_EQ(
        in_message(" SG_ A : 0|8@1+ (" + std::string(1000, '9') + ",0) [0|0] \"\" X"),
        "f.dbc:2:18: found '" + std::string(40, '9') + "...', expected the scale, a finite number");
}

TEST(DbcErrors, NameSignalsThatShareANameOrBits) {
    const std::string a = " SG_ A : 0|8@1+ (1,0) [0|0] \"\" X\n";
    EXPECT_EQ(in_message(a + a),
              "f.dbc:3:6: found 'A', expected a name that no other signal of message 'Msg' has");
    EXPECT_EQ(in_message(a + " SG_ B : 7|1@0+ (1,0) [0|0] \"\" X\n"),
              "f.dbc:3:6: found signal 'B' overlapping signal 'A', expected bits of its own");
    // Little endian 8 to 19 are bits 0-7 of byte 1 and 0-3 of byte 2; big endian 23 to 20 the
    // others.
    const std::string twelve = " SG_ L : 8|12@1+ (1,0) [0|0] \"\" X\n";
    EXPECT_EQ(in_message(twelve + " SG_ B : 23|4@0+ (1,0) [0|0] \"\" X\n"), "no error");
    EXPECT_EQ(in_message(twelve + " SG_ B : 23|5@0+ (1,0) [0|0] \"\" X\n"),
              "f.dbc:3:6: found signal 'B' overlapping signal 'L', expected bits of its own");
}

TEST(DbcErrors, AllowOverlapOnlyBetweenDifferentMultiplexValues) {
    const std::string m =
        " SG_ M M : 0|8@1+ (1,0) [0|0] \"\" X\n SG_ A m0 : 8|8@1+ (1,0) [0|0] \"\" X\n";
    EXPECT_EQ(in_message(m + " SG_ B m1 : 8|8@1+ (1,0) [0|0] \"\" X\n"), "no error");
    EXPECT_EQ(in_message(m + " SG_ B m0 : 15|1@1+ (1,0) [0|0] \"\" X\n"),
              "f.dbc:4:6: found signal 'B' overlapping signal 'A', expected bits of its own");
    EXPECT_EQ(in_message(m + " SG_ B : 15|1@1+ (1,0) [0|0] \"\" X\n"),
              "f.dbc:4:6: found signal 'B' overlapping signal 'A', expected bits of its own");
    EXPECT_EQ(in_message(m + " SG_ B m7 : 7|2@1+ (1,0) [0|0] \"\" X\n"),
              "f.dbc:4:6: found signal 'B' overlapping signal 'M', expected bits of its own");
    const std::string b = m + " SG_ B m3 : 8|8@1+ (1,0) [0|0] \"\" X\n";
    EXPECT_EQ(in_message(b + "SG_MUL_VAL_ 5 B M 1-3;"), "no error");
    EXPECT_EQ(in_message(b + "SG_MUL_VAL_ 5 B M 0-3;"),
              "f.dbc:4:6: found signal 'B' overlapping signal 'A', expected bits of its own");
}

TEST(DbcErrors, NameMultiplexingThatIsIncompleteOrNotSupported) {
    const std::string m = " SG_ M M : 0|2@1+ (1,0) [0|0] \"\" X\n";
    EXPECT_EQ(
        in_message(" SG_ A m0 : 8|8@1+ (1,0) [0|0] \"\" X\n"),
        "f.dbc:2:6: found multiplexed signal 'A', expected a multiplexor (M) in message 'Msg'");
    EXPECT_EQ(in_message(m + " SG_ N M : 8|2@1+ (1,0) [0|0] \"\" X\n"),
              "f.dbc:3:8: found 'M', expected one multiplexor in a message, which is 'M'");
    EXPECT_EQ(in_message(m + " SG_ A m4 : 8|8@1+ (1,0) [0|0] \"\" X\n"),
              "f.dbc:3:6: found multiplex value 4, expected one that the 2 bits of 'M' hold");
    EXPECT_EQ(in_message(m + " SG_ A m0M : 8|8@1+ (1,0) [0|0] \"\" X\n"),
              "f.dbc:3:8: found 'm0M', expected M or m<value>: multiplexors of multiplexors are "
              "not supported");
    EXPECT_EQ(in_message(m + " SG_ A x : 8|8@1+ (1,0) [0|0] \"\" X\n"),
              "f.dbc:3:8: found 'x', expected ':', M or m<value>");
    EXPECT_EQ(in_message(m + " SG_ A m99999999999 : 8|8@1+ (1,0) [0|0] \"\" X\n"),
              "f.dbc:3:8: found 'm99999999999', expected ':', M or m<value>");
    const std::string a =
        m + " SG_ A m0 : 8|8@1+ (1,0) [0|0] \"\" X\n SG_ P : 16|8@1+ (1,0) [0|0] \"\" X\n";
    EXPECT_EQ(in_message(a + "SG_MUL_VAL_ 5 A M 0-1, 3-3;"),
              "f.dbc:5:22: found ',', expected ';': several multiplex ranges are not supported");
    EXPECT_EQ(in_message(a + "SG_MUL_VAL_ 5 A P 0-1;"),
              "f.dbc:5:17: found 'P', expected the multiplexor of message 'Msg'");
    EXPECT_EQ(in_message(a + "SG_MUL_VAL_ 5 P M 0-1;"),
              "f.dbc:5:15: found 'P', expected a multiplexed signal (m<value>)");
    EXPECT_EQ(in_message(a + "SG_MUL_VAL_ 5 A M 2-1;"),
              "f.dbc:5:21: found '1', expected a last value not below the first");
    EXPECT_EQ(in_message(a + "SG_MUL_VAL_ 5 A M 2-9;"),
              "f.dbc:3:6: found multiplex value 9, expected one that the 2 bits of 'M' hold");
    EXPECT_EQ(in_message(" SG_ M M : 0|32@1+ (1,0) [0|0] \"\" X\nSIG_VALTYPE_ 5 M : 1;"),
              "f.dbc:2:6: found multiplexor 'M' of floating type, expected an integer");
}

TEST(DbcErrors, NameStatementsAboutWhatIsNotThere) {
    const std::string a = " SG_ A : 0|16@1+ (1,0) [0|0] \"\" X\n";
    EXPECT_EQ(in_message(a + "VAL_ 6 A 0 \"no\" ;"),
              "f.dbc:3:6: found '6', expected the id of a message declared above");
    EXPECT_EQ(in_message(a + "VAL_ 5 B 0 \"no\" ;"),
              "f.dbc:3:8: found 'B', expected a signal of message 'Msg'");
    EXPECT_EQ(
        in_message(a + "VAL_ 5 A Table ;"),
        "f.dbc:3:10: found 'Table', expected values with names, or a value table declared above");
    EXPECT_EQ(in_message(a + "VAL_ 5 A 0.5 \"no\" ;"),
              "f.dbc:3:10: found '0.5', expected a whole number of at most 64 bits");
    EXPECT_EQ(in_message(a + "VAL_ 5 A 1e30 \"no\" ;"),
              "f.dbc:3:10: found '1e30', expected a whole number of at most 64 bits");
    EXPECT_EQ(in_message(a + "VAL_ 5 A 0 no ;"),
              "f.dbc:3:12: found 'no', expected the value's name as a string");
    EXPECT_EQ(in_message(a + "VAL_ 5 A 0 \"no\" 0 \"yes\" ;"),
              "f.dbc:3:17: found '0', expected a value that has no other name ('no')");
    EXPECT_EQ(in_message(a + "VAL_ 5 A 0 \"no\""),
              "f.dbc:3:16: found end of file, expected a whole number of at most 64 bits");
    EXPECT_EQ(in_message(a + "SIG_VALTYPE_ 5 A : 1;"),
              "f.dbc:3:20: found a floating type for signal 'A' of 16 bits, expected 32 bits");
    EXPECT_EQ(in_message(a + "SIG_VALTYPE_ 5 A : 4;"),
              "f.dbc:3:20: found '4', expected value type 0 or 3 (integer), 1 (32-bit float) or 2 "
              "(64-bit float)");
    EXPECT_EQ(in_message(a + "BA_ \"GenMsgCycleTime\" BO_ 6 25;"),
              "f.dbc:3:27: found '6', expected the id of a message declared above");
    EXPECT_EQ(in_message(a + "BA_ \"GenMsgCycleTime\" BO_ 5 -25;"),
              "f.dbc:3:29: found '-', expected a cycle time of 0 to 4294967295 ms");
    EXPECT_EQ(in_message(a + "BA_ \"GenMsgCycleTime\" BO_ 5 \"fast\";"),
              "f.dbc:3:29: found string \"fast\", expected a cycle time of 0 to 4294967295 ms, a "
              "finite number");
    EXPECT_EQ(error_in_dbc("VAL_TABLE_ T 0 \"a\" ;\nVAL_TABLE_ T 0 \"a\" ;"),
              "f.dbc:2:12: found 'T', expected a name that no other value table has");
}

TEST(DbcErrors, CountColumnsInBytesAndLinesThroughStrings) {
    EXPECT_EQ(error_in_dbc("CM_ \"one\r\ntwo\r\nthree\" ? ;\r\n  oops"),
              "f.dbc:4:3: found 'oops', expected a DBC statement such as BO_, SG_, CM_ or VAL_");
}

TEST(DbcErrors, RefuseAbsurdSizesWithoutDelay) {
    EXPECT_EQ(error_in_dbc(std::string((std::size_t{16} << 20) + 1, ' ')),
              "f.dbc: found 16777217 bytes, expected at most 16777216");
    std::string many = "BO_ 5 Msg: 8 Box\n SG_ M M : 0|32@1+ (1,0) [0|0] \"\" X\n";
    for (int i = 0; i < 5000; ++i) {
        many += " SG_ S" + std::to_string(i) + " m" + std::to_string(i) +
                " : 32|8@1+ (1,0) [0|0] \"\" X\n";
    }
    EXPECT_EQ(error_in_dbc(many),
              "f.dbc:4098:6: found 'S4095', expected at most 4096 signals in a message");
    EXPECT_TRUE(error_in_dbc(std::string(1000000, '(')).starts_with("f.dbc:1:1: found '('"));
    EXPECT_TRUE(error_in_dbc("BU_:" + std::string(1000000, 'a')) == "no error");
}

TEST(DbcErrors, AreTheOnlyAnswerToDamagedFiles) {
    // GIVEN the rig's file with random damage: bytes changed, removed, doubled, cut off
    const char* chosen = std::getenv("VIBRIG_SEED");
    const unsigned long seed = chosen != nullptr ? std::strtoul(chosen, nullptr, 10) : 7;
    SCOPED_TRACE(testing::Message() << "VIBRIG_SEED=" << seed);
    std::mt19937_64 random(seed);
    const std::string sound(rig_dbc_text());
    int refused = 0;
    for (int i = 0; i < 400; ++i) {
        std::string text = sound;
        for (std::uint64_t n = random() % 4 + 1; n > 0; --n) {
            const std::size_t at = random() % text.size();
            switch (random() % 4) {
                case 0:
                    text[at] = static_cast<char>(random());
                    break;
                case 1:
                    text.erase(at, random() % 30);
                    break;
                case 2:
                    text.insert(at, text.substr(random() % text.size(), random() % 60));
                    break;
                default:
                    if (random() % 8 == 0) text.resize(at + 1);
            }
        }
        // WHEN it is read THEN it is either accepted or refused with a place in it
        try {
            (void)parse_dbc(text, "f.dbc");
        } catch (const DbcError& failure) {
            ++refused;
            EXPECT_GE(failure.line(), 1) << failure.what();
            EXPECT_GE(failure.column(), 1) << failure.what();
        }
    }
    EXPECT_GT(refused, 100);
}

}  // namespace
}  // namespace vibrig::proto
