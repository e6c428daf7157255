#include "daemon/commission/bus_bits.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <filesystem>

namespace vibrig::commission {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class Bits : public ::testing::Test {
  protected:
    void SetUp() override { std::filesystem::remove_all(folder); }
    void TearDown() override { std::filesystem::remove_all(folder); }
    void send(BitWatch& watch, double value) const {
        const proto::Message* message = dbc.find(std::string_view("Resolvers"));
        std::array<std::uint8_t, 8> data{};
        EXPECT_TRUE(proto::encode(*message->find("OuterValid"), value, data));
        watch.add(message->id, message->extended, std::span(data).first(message->size));
    }
    const proto::Dbc dbc = proto::parse_dbc(proto::rig_dbc_text(), "rig.dbc");
    const std::filesystem::path folder =
        std::filesystem::path(::testing::TempDir()) / ("bits" + std::to_string(::getpid()));
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

}  // namespace
}  // namespace vibrig::commission
