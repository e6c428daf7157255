#include "proto/dbc.hpp"
#include "tests/unit/support/temporary_folder.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

namespace vibrig::proto {
namespace {

constexpr const char* kFull = R"(VERSION "HIPBNYYYYYYYYYYYYYYYYYYYYYYYYYYYYYYYYYYYYYYY"

NS_ :
	NS_DESC_
	CM_
	BA_DEF_
	BA_
	VAL_
	CAT_DEF_
	CAT_
	FILTER
	BA_DEF_DEF_
	EV_DATA_
	ENVVAR_DATA_
	SGTYPE_
	SIG_GROUP_
	SIG_VALTYPE_
	SIGTYPE_VALTYPE_
	BO_TX_BU_
	SG_MUL_VAL_

BS_: 500000 : 12,34

BU_: Box Daemon
VAL_TABLE_ YesNo 1 "yes" 0 "no" ;
VAL_TABLE_ Empty ;

BO_ 3221225472 VECTOR__INDEPENDENT_SIG_MSG: 0 Vector__XXX
 SG_ Orphan : 0|0@1+ (0,0) [0|0] "" Vector__XXX

BO_ 291 Angles: 8 Box
 SG_ Outer : 7|20@0+ (0.5,-10) [0|360] "deg" Daemon,Other
 SG_ Temperature : 24|16@1- (1E-2,+2.5e+1) [-40|85] "°C"  Daemon
 SG_ Valid : 63|1@1+ (1,0) [0|0] "" Vector__XXX

BO_ 2550137598 Extended: 64 Vector__XXX
 SG_ Single : 0|32@1- (1,0) [0|0] "" Daemon
 SG_ Double : 455|64@0- (1,0) [0|0] "" Daemon

BO_ 3 Switched : 8 Box
 SG_ Which M : 0|4@1+ (1,0) [0|0] "" Daemon
 SG_ A m0 : 8|16@1+ (1,0) [0|0] "" Daemon
 SG_ B m1 : 8|16@1+ (1,0) [0|0] "" Daemon
 SG_ C m2 : 8|8@1+ (1,0) [0|0] "" Daemon

BO_TX_BU_ 291 : Box,Daemon;
EV_ Light: 0 [0|1] "" 0 2 DUMMY_NODE_VECTOR0 Vector__XXX;
ENVVAR_DATA_ Light: 5;
CM_ "A text
of two lines; with BO_ 1 X: 8 Y and a \"quotation\"";
CM_ SG_ 291 Outer "outer gimbal";
CM_ BU_ Box "resolver box";
BA_DEF_ "BusType" STRING ;
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_ SG_ "Kind" ENUM "one","two;three";
BA_DEF_DEF_ "BusType" "";
BA_DEF_DEF_ "GenMsgCycleTime" 100;
BA_DEF_DEF_ "Kind" "one";
BA_ "BusType" "CAN FD";
BA_ "GenMsgCycleTime" BO_ 291 25;
BA_ "GenMsgCycleTime" BO_ 3 0;
BA_ "GenMsgCycleTime" BO_ 3221225472 9;
BA_ "Kind" SG_ 291 Outer 1;
BA_REL_ "Whatever" BU_SG_REL_ Box SG_ 291 Outer 3;
VAL_ 291 Valid YesNo ;
VAL_ 291 Temperature -1 "below" 32767 "none" 1.0 "one" ;
VAL_ 3221225472 Orphan 0 "nothing" ;
VAL_ Light 0 "off" 1 "on" ;
SIG_GROUP_ 291 All 1 : Outer Temperature;
SIG_VALTYPE_ 2550137598 Single : 1;
SIG_VALTYPE_ 2550137598 Double :2;
SG_MUL_VAL_ 3 C Which 2-5;
)";

void expect_full(const Dbc& dbc) {
    ASSERT_EQ(dbc.messages.size(), 3U);
    const Message* angles = dbc.find("Angles");
    ASSERT_NE(angles, nullptr);
    EXPECT_EQ(dbc.find(291, false), angles);
    EXPECT_EQ(dbc.find(291, true), nullptr);
    EXPECT_EQ(angles->size, 8);
    EXPECT_EQ(angles->sender, "Box");
    EXPECT_EQ(angles->cycle_time_ms, 25U);
    ASSERT_EQ(angles->signals.size(), 3U);
    const Signal* outer = angles->find("Outer");
    ASSERT_NE(outer, nullptr);
    EXPECT_EQ(outer->start_bit, 7);
    EXPECT_EQ(outer->length, 20);
    EXPECT_EQ(outer->order, ByteOrder::big);
    EXPECT_FALSE(outer->is_signed);
    EXPECT_EQ(outer->scale, 0.5);
    EXPECT_EQ(outer->offset, -10);
    EXPECT_EQ(outer->minimum, 0);
    EXPECT_EQ(outer->maximum, 360);
    EXPECT_EQ(outer->unit, "deg");
    const Signal* temperature = angles->find("Temperature");
    ASSERT_NE(temperature, nullptr);
    EXPECT_TRUE(temperature->is_signed);
    EXPECT_EQ(temperature->order, ByteOrder::little);
    EXPECT_EQ(temperature->scale, 0.01);
    EXPECT_EQ(temperature->offset, 25);
    EXPECT_EQ(temperature->unit,
              "\xc2\xb0"
              "C");
    const std::map<std::int64_t, std::string> names{{-1, "below"}, {1, "one"}, {32767, "none"}};
    EXPECT_EQ(temperature->value_names, names);
    EXPECT_EQ(angles->find("Valid")->value_names.at(1), "yes");

    const Message* extended = dbc.find(2550137598U - 0x80000000U, true);
    ASSERT_NE(extended, nullptr);
    EXPECT_EQ(extended->size, 64);
    EXPECT_EQ(extended->cycle_time_ms, 100U) << "the attribute's default";
    EXPECT_EQ(extended->find("Single")->type, ValueType::float32);
    EXPECT_EQ(extended->find("Double")->type, ValueType::float64);

    const Message* switched = dbc.find("Switched");
    ASSERT_NE(switched, nullptr);
    EXPECT_FALSE(switched->cycle_time_ms.has_value()) << "0 ms: not cyclic";
    EXPECT_EQ(switched->multiplexor(), switched->find("Which"));
    EXPECT_EQ(switched->find("B")->multiplex_value, 1U);
    EXPECT_FALSE(switched->find("B")->multiplex_last.has_value());
    EXPECT_EQ(switched->find("C")->multiplex_last, 5U);
    EXPECT_EQ(switched->find("Nothing"), nullptr);
    EXPECT_EQ(dbc.find("Nothing"), nullptr);
}

TEST(Dbc, ReadsEveryStatement) { expect_full(parse_dbc(kFull, "full.dbc")); }

TEST(Dbc, ReadsFilesWithCrLfAndAByteOrderMark) {
    std::string text = "\xef\xbb\xbf";
    for (const char* c = kFull; *c != '\0'; ++c) {
        if (*c == '\n') text += '\r';
        text += *c;
    }
    expect_full(parse_dbc(text, "full.dbc"));
}

TEST(Dbc, ReadsLatin1StringsAsUtf8) {
    std::string text = kFull;
    const std::size_t degree = text.find("\xc2\xb0");
    text.erase(degree, 1);  // the lone byte B0 is Latin-1's degree sign
    expect_full(parse_dbc(text, "full.dbc"));
}

TEST(Dbc, ReadsMessagesWithoutSignalsAndSignalsWithoutReceivers) {
    const Dbc dbc = parse_dbc(
        "BO_ 1 A: 0 X\nBO_ 2 B: 1 X SG_ S : 0|4@1+ (1,0) [0|0] \"\"\n SG_ T : 4|4@1+ (1,0) [0|0] "
        "\"\"",
        "a.dbc");
    ASSERT_EQ(dbc.messages.size(), 2U);
    EXPECT_TRUE(dbc.messages[0].signals.empty());
    EXPECT_EQ(dbc.messages[1].signals.size(), 2U);
}

TEST(Dbc, IsReadFromAFile) {
    const TemporaryFolder folder;
    const std::string path = (folder / "full.dbc").string();
    std::ofstream(path) << kFull;
    expect_full(read_dbc(path));
    std::filesystem::remove(path);
    try {
        (void)read_dbc(path);
        FAIL() << "no error";
    } catch (const DbcError& error) {
        EXPECT_EQ(error.what(), path + ": cannot be opened: No such file or directory");
    }
    EXPECT_THROW((void)read_dbc("/"), DbcError);
}

}  // namespace
}  // namespace vibrig::proto
