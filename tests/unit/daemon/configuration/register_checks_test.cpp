#include <string>

#include "tests/unit/daemon/configuration/spectrum_keys.hpp"
#include "tests/unit/daemon/configuration/support.hpp"

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

}  // namespace
}  // namespace vibrig::configuration
