// Who has written what to a controller while no daemon has the rig.
#include "daemon/commission/trial_log.hpp"
#include "tests/unit/support/temporary_folder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

namespace vibrig::commission {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class Logged : public ::testing::Test, public TrialPort {
  protected:
    Answer read(proto::RegisterTable /*table*/, std::uint16_t address,
                std::span<std::uint16_t> words) override {
        std::copy_n(holding.begin() + address, words.size(), words.begin());
        return Answer::done;
    }
    Answer write(std::uint16_t address, std::span<const std::uint16_t> words) override {
        std::ifstream file(folder / "registers.jsonl");
        const std::string before{std::istreambuf_iterator<char>(file), {}};
        EXPECT_THAT(before, HasSubstr("\"address\":" + std::to_string(address)))
            << "on disk before it is sent";
        if (refuses) return Answer::refused;
        std::ranges::copy(words, holding.begin() + address);
        return Answer::done;
    }
    void wait(double /*seconds*/) override {}
    [[nodiscard]] double now_s() const override { return 0; }

    TemporaryFolder folder;
    std::array<std::uint16_t, 16> holding{0, 15000, 0, 0, 100, 0, 0, 1500};
    bool refuses = false;
};

TEST_F(Logged, WhatWasTriedIsThatOfTheseRegistersAndOfNoOthers) {
    TriedRegisters::Keys keys{{"shaker.registers.run.address", "71"},
                              {"shaker.registers.run.type", "\"u16\""}};
    const TriedRegisters tried(folder.string());
    EXPECT_THAT(tried.lacks(keys), HasSubstr("were not tried one by one"));
    std::filesystem::create_directories(folder);
    tried.keep(keys, "Ada", "ACME", 1'795'000'000'000'000'000);
    EXPECT_EQ(TriedRegisters(folder.string()).lacks(keys), "");
    keys["shaker.registers.run.address"] = "72";
    EXPECT_THAT(tried.lacks(keys),
                HasSubstr("shaker.registers.run.address is 72, was 71 when it was tried: vibrig "
                          "commission registers --write"));
    keys = {{"shaker.registers.ramp_time.address", "70"}};
    EXPECT_THAT(tried.lacks(keys),
                HasSubstr("shaker.registers.ramp_time.address is 70, was not known when it"));
    std::ofstream(folder / "registers.json") << "nonsense";
    EXPECT_THAT(tried.lacks(keys), HasSubstr("were not tried"));
}

TEST_F(Logged, ALineThatAPowerCutHasHalvedTakesNoOtherWithIt) {
    std::filesystem::create_directories(folder);
    std::ofstream(folder / "registers.jsonl") << R"({"what":"wri)";
    TrialLog(folder.string(), "Ada").add("begin", TrialLog::Json::object());
    const auto lines = TrialLog::take(folder.string());
    ASSERT_EQ(lines.size(), 2U);
    EXPECT_EQ(lines[0]["text"], R"({"what":"wri)");
    EXPECT_EQ(lines[1]["what"], "begin");
}

TEST_F(Logged, AWriteIsKeptWithWhoWhenAddressOldAndNewValue) {
    {
        TrialLog log(folder.string(), "Ada");
        LoggedPort port(*this, log, proto::ShakerRegisters{});
        const std::array<std::uint16_t, 2> sixteen{0, 16000};
        EXPECT_EQ(port.write(0, sixteen), Answer::done);
        refuses = true;
        const std::array<std::uint16_t, 1> one{1};
        EXPECT_EQ(port.write(9, one), Answer::refused);
    }
    const auto lines = TrialLog::take(folder.string());
    ASSERT_EQ(lines.size(), 4U);
    EXPECT_EQ(lines[0]["by"], "Ada");
    EXPECT_THAT(lines[0]["identity"].get<std::string>(),
                HasSubstr("uid " + std::to_string(::getuid())));
    EXPECT_GT(lines[0]["utc_ns"].get<std::int64_t>(), 0);
    EXPECT_EQ(lines[0]["register"], "frequency");
    EXPECT_EQ(lines[0]["old"]["words"], (std::vector<int>{0, 15000}));
    EXPECT_DOUBLE_EQ(lines[0]["old"]["value"], 15);
    EXPECT_DOUBLE_EQ(lines[0]["new"]["value"], 16);
    EXPECT_EQ(lines[1]["answer"], "done");
    EXPECT_EQ(lines[2]["address"], 9) << "of no stated register";
    EXPECT_EQ(lines[2]["new"]["value"], nullptr);
    EXPECT_EQ(lines[3]["answer"], "refused");
    // AND what was taken is kept, and not taken twice.
    EXPECT_THAT(TrialLog::take(folder.string()), IsEmpty());
    EXPECT_TRUE(std::filesystem::exists(folder / "registers.jsonl.1"));
}

TEST_F(Logged, WhatCannotBeKeptIsNotWritten) {
    // A folder in the file's place.
    std::filesystem::create_directories(folder / "registers.jsonl");
    EXPECT_THROW(TrialLog(folder.string(), "Ada"), std::runtime_error);
}

TEST_F(Logged, ALineThatIsHalvedStandsAsItIs) {
    std::filesystem::create_directories(folder);
    std::ofstream(folder / "registers.jsonl") << "{\"what\":\"write\"}\n{\"wha";
    const auto lines = TrialLog::take(folder.string());
    ASSERT_EQ(lines.size(), 2U);
    EXPECT_EQ(lines[1]["text"], "{\"wha");
}

}  // namespace
}  // namespace vibrig::commission
