#include "daemon/commission/bus_bits.hpp"
#include "tests/unit/support/temporary_folder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <fstream>

namespace vibrig::commission {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class Bits : public ::testing::Test {
  protected:
    void send(BitWatch& watch, double value) const {
        const proto::Message* message = dbc.find(std::string_view("Resolvers"));
        std::array<std::uint8_t, 8> data{};
        EXPECT_TRUE(proto::encode(*message->find("OuterValid"), value, data));
        watch.add(message->id, message->extended, std::span(data).first(message->size));
    }
    const proto::Dbc dbc = proto::parse_dbc(proto::rig_dbc_text(), "rig.dbc");
    const TemporaryFolder temporary;
    const std::filesystem::path folder = temporary / "of_the_test";  // not there at first
};

TEST_F(Bits, OneIsProvenByChangingItOnceAndBack) {
    BitWatch watch(dbc, "Resolvers.OuterValid");
    EXPECT_FALSE(watch.heard());
    for (const double value : {1, 1, 1}) send(watch, value);
    EXPECT_TRUE(watch.heard() && !watch.changed());
    EXPECT_EQ(watch.before(), 1);
    send(watch, 0);
    EXPECT_TRUE(watch.changed() && !watch.came_back());
    send(watch, 0);
    EXPECT_FALSE(watch.came_back());
    send(watch, 1);
    EXPECT_TRUE(watch.came_back());
    send(watch, 0);
    EXPECT_TRUE(watch.came_back()) << "once is enough";
    watch.add(0x7ff, false, {});
    EXPECT_THROW(BitWatch(dbc, "Resolvers.Nothing"), std::invalid_argument);
}

TEST_F(Bits, TwoNamesAreTwoPersons) {
    EXPECT_THAT(two_names(" A. Person ,B. Person"), ElementsAre("A. Person", "B. Person"));
    for (const char* text : {"", "A. Person", "A. Person,", ", B", "ada, Ada", "A,  "})
        EXPECT_THAT(two_names(text), IsEmpty()) << text;
}

TEST_F(Bits, AreKeptOfOneDbcAndNoOther) {
    BitBook book(folder.string(), "abc");
    EXPECT_TRUE(book.bits().empty());
    book.keep({{"Resolvers.OuterValid", true, {"Ada"}, 1}}, 1'795'000'000'000'000'000);
    book.keep({{"Status.Fault", false, {"Ada", "Bo"}, 0}}, 1'795'000'000'000'000'000);
    const auto bits = BitBook(folder.string(), "abc").bits();
    EXPECT_EQ(bits["Resolvers.OuterValid"]["proven"], "changed once and back");
    EXPECT_EQ(bits["Status.Fault"]["by"][1], "Bo");
    EXPECT_EQ(bits["Status.Fault"]["utc"], "2026-11-18T11:06:40Z");
    EXPECT_TRUE(BitBook(folder.string(), "abd").bits().empty());
}

TEST_F(Bits, OfAConfigurationAreUnprovenUntilSomebodyHasThem) {
    configuration::Loaded loaded;
    loaded.configuration.commission.folder = folder.string();
    const auto says = [&loaded](const char* key, const char* value) {
        configuration::EffectiveValue one;
        one.key = key;
        one.value = value;
        loaded.effective.push_back(one);
    };
    says("can.signals.outer_valid", R"("Resolvers.OuterValid")");
    says("can.signals.inner_valid", R"("Resolvers.OuterValid")");
    says("can.signals.fault", R"("Status.Nothing")");
    says("can.signals.outer", R"("Resolvers.Outer")");
    says("can.signals.ready", "not JSON");
    EXPECT_THAT(unproven_bits(loaded, dbc), ElementsAre("Resolvers.OuterValid")) << "once";
    BitBook book(loaded.configuration);
    book.keep({{"Resolvers.OuterValid", true, {"Ada"}, 1}}, 0);
    EXPECT_THAT(unproven_bits(loaded, dbc), IsEmpty());
    loaded.configuration.dbc = "/nowhere/rig.dbc";
    EXPECT_THROW(static_cast<void>(unproven_bits(loaded, dbc)), std::runtime_error);
}

TEST_F(Bits, AFileThatSomebodyHasWrittenOtherwiseProvesNothing) {
    std::filesystem::create_directories(folder);
    for (const char* text : {"", "{", "[]", "null", R"({"dbc_sha256":5})",
                             R"({"dbc_sha256":"abc"})", R"({"dbc_sha256":"abc","bits":5})",
                             R"({"dbc_sha256":"abc","bits":["Resolvers.OuterValid"]})"}) {
        std::ofstream(folder / "bus_bits.json") << text;
        BitBook::Json bits;
        ASSERT_NO_THROW(bits = BitBook(folder.string(), "abc").bits()) << text;
        EXPECT_TRUE(bits.is_object() && bits.empty()) << text;
    }
}

TEST_F(Bits, AConfirmationDoesNotReplaceAProof) {
    const BitBook::Json proven{{"a.b", {{"proven", "changed once and back"}}}};
    const auto all = with_confirmed(proven, BitBook::Json{"a.b", "c.d", 7}, {"Ada", "Bo"}, 0);
    EXPECT_EQ(all["a.b"]["proven"], "changed once and back");
    EXPECT_EQ(all["c.d"]["proven"], "confirmed");
    EXPECT_EQ(all["c.d"]["by"][1], "Bo");
    EXPECT_EQ(all.size(), 2U);
}

TEST_F(Bits, LengthIsTheSignalsOrNone) {
    EXPECT_EQ(length_of(dbc, "Resolvers.OuterValid"), 1);
    for (const char* name : {"", "Resolvers", "Resolvers.", ".OuterValid", "Nothing.OuterValid"})
        EXPECT_EQ(length_of(dbc, name), 0) << name;
}

}  // namespace
}  // namespace vibrig::commission
