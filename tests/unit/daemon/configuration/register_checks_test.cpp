#include <fstream>
#include <string>

#include "tests/unit/daemon/configuration/spectrum_keys.hpp"
#include "tests/unit/daemon/configuration/support.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::configuration {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

TEST(RandomRegisters, AreNoneUnlessStatedAndThenAsStated) {
    EXPECT_FALSE(accepted("", true).shaker.registers.random);
    const auto map = accepted("spectrum.mode = \"mixed\"\n" + kRandomRegisters, true)
                         .shaker.registers.random.value();
    EXPECT_EQ(map.profile_level_db.type, proto::RegisterType::i16);
    EXPECT_EQ(map.profile_level_db.scale, 0.1);
    EXPECT_EQ(map.control_state.table, proto::RegisterTable::input);
    const auto shown = [](const std::string& text) {
        return format_effective(parse(as_simulated(text, true), "rig.toml", true));
    };
    EXPECT_THAT(shown(kRandomRegisters), HasSubstr("shaker.registers.profile_checksum.address"));
    EXPECT_THAT(shown(""), Not(HasSubstr("profile_checksum")));
}

TEST(RandomRegisters, EachMissingOrUnfitRoleIsNamed) {
    const auto without = [](const std::string& role) {
        std::string text = kRandomRegisters;
        const auto at = text.find(role);
        return complaint(text.erase(at, text.find('\n', at) + 1 - at), true);
    };
    for (const char* role : {"mode", "profile_number", "profile_level_db", "profile_checksum",
                             "measured_g_rms", "control_state"})
        EXPECT_THAT(without(role), AllOf(HasSubstr(std::string("shaker.registers.") + role +
                                                   ".address: found nothing, expected an address"),
                                         HasSubstr("random vibration needs mode, profile_number")))
            << role;
    const auto with = [](const std::string& line) {
        std::string text = kRandomRegisters;
        const auto at = text.find(line.substr(0, line.find(' ')));
        text.replace(at, text.find("\n", at) - at, line);
        return complaint(text, true);
    };
    EXPECT_THAT(with("profile_level_db = { address = 10, type = \"u16\" }"),
                AllOf(StartsWith("rig.toml:4:"), HasSubstr("profile_level_db.type"),
                      HasSubstr("found u16, expected i16, i32 or f32")));
    EXPECT_THAT(with("profile_checksum = { address = 5, type = \"f32\" }"),
                HasSubstr("profile_checksum.type: found f32, expected u32"));
    EXPECT_THAT(with("mode = { address = 8, table = \"input\" }"),
                HasSubstr("mode.table: found \"input\", expected \"holding\""));
    EXPECT_THAT(with("mode = { address = 5 }"),
                HasSubstr("expected written registers that do not"));
    EXPECT_THAT(with("control_state = { address = 9, type = \"bits\" }"),
                HasSubstr("control_state.type: found bits"));
}

/// A function, since another file's text need not be there before main().
std::string psd_block_keys() {
    return kRandomRegisters +
           "psd_block = { address = 100, word_order = \"little\", pairs = 300, attempts = 3 }\n";
}

TEST(PsdBlock, IsWhereItIsStated) {
    const std::string text = "spectrum.controller_psd = \"registers\"\n" + psd_block_keys();
    const auto c = accepted(text, true);
    ASSERT_TRUE(c.shaker.registers.random && c.shaker.registers.random->psd_block);
    const proto::PsdBlock& block = *c.shaker.registers.random->psd_block;
    EXPECT_EQ(block.first.address, 100);
    EXPECT_EQ(block.first.order, proto::WordOrder::little);
    EXPECT_EQ(block.first.table, proto::RegisterTable::input);
    EXPECT_EQ(block.pairs, 300);
    EXPECT_EQ(block.attempts, 3);
    EXPECT_TRUE(c.campaign.read_psd);
    EXPECT_FALSE(accepted(psd_block_keys(), true).campaign.read_psd);
    const auto shown = format_effective(parse(as_simulated(text, true), "rig.toml", true));
    EXPECT_THAT(shown, HasSubstr("shaker.registers.psd_block.pairs"));
    const auto none =
        format_effective(parse(as_simulated(kRandomRegisters, true), "rig.toml", true));
    EXPECT_THAT(none, Not(HasSubstr("psd_block.address")));
}

TEST(PsdBlock, OneThatCannotBeReadIsNamed) {
    const auto with = [](const std::string& block) {
        return complaint(kRandomRegisters + "psd_block = { " + block + " }\n", true);
    };
    EXPECT_THAT(with("pairs = 100"), HasSubstr("psd_block.address: found nothing, expected an"));
    EXPECT_THAT(with("address = 100, type = \"u16\""),
                HasSubstr("psd_block.type: found u16, expected f32: pairs of floats"));
    EXPECT_THAT(with("address = 65000, pairs = 200"),
                HasSubstr("found 200 pairs from 65000, expected 134 pairs of 4 words at most"));
    EXPECT_THAT(with("address = 100, access = \"write\""), HasSubstr("psd_block.access"));
    EXPECT_THAT(with("address = 100, pairs = 1"), HasSubstr("psd_block.pairs"));
}

TEST(SpectrumKeys, RegistersOfSweepsAreAllThereOrNone) {
    std::string some = kSweepRegisters;
    some = some.substr(0, some.find("shaker.registers.sweep_rate"));
    EXPECT_THAT(complaint(some, true),
                AllOf(HasSubstr("shaker.registers.sweep_rate.address: found nothing"),
                      HasSubstr("shaker.registers.actual_frequency.address: found nothing")));
    EXPECT_EQ(complaint(kSweepRegisters, true), "");
    const auto c = accepted(kSweepRegisters, true);
    ASSERT_TRUE(c.shaker.registers.sweep);
    EXPECT_FALSE(c.shaker.registers.random);
    EXPECT_EQ(c.shaker.registers.sweep->rate.scale, 0.01);
    // What is written is no input register.
    std::string input = kSweepRegisters;
    input.replace(input.find("type = \"u32\""), 0, "table = \"input\", ");
    EXPECT_THAT(complaint(input, true), AllOf(HasSubstr("shaker.registers.sweep_from.table"),
                                              HasSubstr("this register is written")));
}

/// Else a campaign ends hours later, where it reads back what it has not asked for.
TEST(WatchdogTimeoutRegister, HoldsATimeoutThatWorks) {
    const auto said = [](const std::string& text) { return complaint(text, true); };
    const std::string key = "shaker.registers.watchdog_timeout.scale = ";
    EXPECT_EQ(said(key + "1\n"), "") << "1.5 s, which it holds as 2 s";
    // WHEN it is counted in tens of seconds, or in minutes
    for (const char* scale : {"10\n", "60\n"})
        EXPECT_THAT(said(key + scale), HasSubstr("1.5 s to be written, which the register holds as "
                                                 "0 s, expected more than 0.5 s"))
            << "which switches it off";
    EXPECT_THAT(said(key + "1\nshaker.watchdog_period_ms = 150\n"),
                HasSubstr("0.45 s to be written, which the register holds as 0 s"));
    EXPECT_THAT(said(key + "2\nshaker.watchdog_period_ms = 1000\n"),
                HasSubstr("holds as 4 s, expected more than 1 s, the feeds' period, and 3 s at "
                          "most"));
}

TEST(SetPointsOfAPlan, AreHeldByTheirRegisters) {
    const TemporaryFolder folder;
    const std::string path = folder.file("plan.json");
    const auto said = [&](const std::string& run, const std::string& registers) {
        std::ofstream(path) << R"({"runs":[{"position":[0,0,0],"table_g":3,"frequency_hz":15},)"
                            << R"({"position":[0,0,0],)" << run << "}]}";
        return complaint("campaign.plan = \"" + path +
                             "\"\ncampaign.identify = \"what-it-can\"\n"
                             "spectrum.mount = \"hard\"\n" +
                             registers,
                         true);
    };
    const std::string u16 = "shaker.registers.frequency = { type = \"u16\", scale = ";
    const std::string at_85 = R"("table_g":3,"frequency_hz":85.1)";
    EXPECT_EQ(said(at_85, ""), "");
    EXPECT_EQ(said(at_85, u16 + "0.1 }\n"), "");
    EXPECT_THAT(said(at_85, u16 + "0.001 }\n"),
                HasSubstr("found dwell 2: 85.1 Hz to be written, expected a register that holds it "
                          "(65.535 Hz at most)"));
    EXPECT_THAT(said(R"("table_g":3,"frequency_hz":85.05)", u16 + "0.1 }\n"),
                HasSubstr("found dwell 2: 85.05 Hz to be written, expected a multiple of 0.1 Hz, "
                          "the step of shaker.registers.frequency"));
    EXPECT_THAT(
        said(R"("table_g":7,"frequency_hz":85.1)", "shaker.registers.amplitude.type = \"u16\"\n"),
        HasSubstr("found dwell 2: 7 g to be written, expected a register that holds it (6.5535 g"));

    const std::string random = "spectrum.mode = \"mixed\"\n" + kRandomRegisters +
                               profile_with("psd = [[20, 0.02], [120, 0.02]]\nnumber = 4\n");
    const auto at_level = [&](const std::string& db) {
        return said(R"("profile":"p","level_db":)" + db, random);
    };
    for (const char* db : {"0", "-1.5", "0.3", "-0.7"}) EXPECT_EQ(at_level(db), "") << db;
    // -1.53 would be played as -1.5 and recorded as -1.53.
    for (const char* db : {"-1.53", "-1.55"})
        EXPECT_THAT(at_level(db),
                    HasSubstr(std::string("found dwell 2: ") + db +
                              " dB to be written, expected a multiple of 0.1 dB, the step of "
                              "shaker.registers.profile_level_db"));
}

TEST(SetPointsOfAPlan, AreHeldByTheRegistersOfItsSweeps) {
    const TemporaryFolder folder;
    const std::string path = folder.file("plan.json");
    std::ofstream(path) << R"({"runs":[{"position":[0,0,0],"table_g":3,"frequency_hz":15},)"
                        << R"({"position":[0,0,0],"table_g":3,)"
                        << R"("sweep":{"from_hz":20,"to_hz":120,"s":100}}]})";
    const std::string text = "campaign.plan = \"" + path +
                             "\"\ncampaign.identify = \"what-it-can\"\ncan.sample_rate_hz = 200\n"
                             "spectrum.mount = \"hard\"\nspectrum.mode = \"mixed\"\n";
    EXPECT_EQ(complaint(text + kSweepRegisters, true), "");
    std::string narrow = kSweepRegisters;
    const std::string to = "sweep_to = { address = 13, type = \"u32\"";
    narrow.replace(narrow.find(to), to.size(), "sweep_to = { address = 13, type = \"u16\"");
    EXPECT_THAT(complaint(text + narrow, true),
                HasSubstr("found dwell 2: 120 Hz to be written, expected a register that holds it "
                          "(65.535 Hz at most)"));
}

}  // namespace
}  // namespace vibrig::configuration
