#include "daemon/record/candump_campaign.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/fmt/fmt.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "drivers/sample/channels.hpp"
#include "proto/dbc.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::record {
namespace {

namespace fs = std::filesystem;
using drivers::Channel;
using drivers::Quality;
using ::testing::HasSubstr;

/// Twenty samples of the rig on its bus, beside the configuration of the build that recorded them.
class CandumpCampaign : public ::testing::Test {
  protected:
    CandumpCampaign() {
        fs::create_directories(folder_);
        std::ofstream log(folder_ / "raw-0001.log");
        for (int i = 0; i < 20; ++i) {
            const auto line = [&](const std::string& frame, const std::string& last) {
                log << fmt::format("(1700000000.{:06}) vcan0 {}{} R\n", 25'000 * i, frame, last);
            };
            const std::string low = fmt::format("{:02X}", i);
            line("080#", low + "00000000000000");
            line("101#FFFFEFFFFF0300", low);
            line("102#FEFF0F00000100", low);
            line("110#FBFFFF06000403", low);
            line("111#12000000000001", low);
            line("112#0D000000000000", low);
        }
    }
    ~CandumpCampaign() override {
        std::error_code ignored;
        fs::remove_all(folder_, ignored);
    }

    /// As `format_effective` has it, without the keys that the older build did not have.
    static std::string configuration_without(const std::string& lacks) {
        std::string text =
            "can.sample_rate_hz = 40.0\ncan.signals.sync_count = \"Sync.SyncCount\"\n";
        const drivers::SignalBindings defaults;
        const auto list = [&](const std::string& name,
                              std::string drivers::SignalBindings::*signal) {
            if (signal == nullptr || name == lacks) return;
            text += "can.signals." + name + "  =  \"" + defaults.*signal + "\"  # -\n";
        };
        for (const auto& row : drivers::kChannelTable) {
            list(row.name, row.signal);
            list(std::string(row.name) + "_valid", row.valid);
        }
        for (const auto& row : drivers::kStatusTable) list(row.name, row.signal);
        return text;
    }
    /// The rig's, without the lines about a message.
    static std::string dbc_without(const std::string& name, const std::string& number) {
        std::string text(proto::rig_dbc_text());
        const auto begin = text.find("BO_ " + number + " " + name);
        text.erase(begin, text.find("\nBO_ ", begin) + 1 - begin);
        for (const std::string& about :
             std::vector<std::string>{"CM_ SG_ " + number, "BA_ \"GenMsgCycleTime\" BO_ " + number})
            for (auto at = text.find(about); at != std::string::npos; at = text.find(about))
                text.erase(at, text.find('\n', at) + 1 - at);
        return text;
    }
    [[nodiscard]] Campaign read(const std::string& configuration, const std::string& dbc) const {
        Campaign campaign;
        campaign.folder = folder_.string();
        campaign.head.configuration = configuration;
        campaign.head.dbc = dbc;
        drivers::Time until = 0;
        campaign.samples = samples_from_raw(campaign, until);
        return campaign;
    }

    TemporaryFolder folder_;
};

TEST_F(CandumpCampaign, OfAnOlderBuildHasNoneOfTheSignalsThatItDidNotKnow) {
    // GIVEN a bus without the table's accelerometer, and a build that did not know one
    const auto samples =
        read(configuration_without("table_accel"), dbc_without("TableAccelerometer", "274"))
            .samples;
    // THEN it is as if no signal were bound to it, and the others are there
    ASSERT_GE(samples.size(), 15U);
    EXPECT_EQ(samples[10].of(Channel::table_accel), Quality::unbound);
    EXPECT_TRUE(samples[10].angles_good());
    EXPECT_TRUE(samples[10].force_good());
    // AND a name that means another signal on that bus is not taken for it
    EXPECT_EQ(read(configuration_without("table_accel"), "").samples[10].of(Channel::table_accel),
              Quality::unbound);
    EXPECT_EQ(read(configuration_without(""), "").samples[10].of(Channel::table_accel),
              Quality::good);
    // AND a word of the platform or a validity that it did not know is none
    EXPECT_TRUE(read(configuration_without("loop_closed"), "").samples[10].angles_good());
    EXPECT_EQ(read(configuration_without("outer_valid"), "").samples[10].of(Channel::outer),
              Quality::good);
}

TEST_F(CandumpCampaign, ThatKnewASignalIsRefusedIfItsBusHasNone) {
    try {
        static_cast<void>(
            read(configuration_without(""), dbc_without("TableAccelerometer", "274")));
        ADD_FAILURE() << "it was read";
    } catch (const std::runtime_error& error) {
        EXPECT_THAT(error.what(), HasSubstr("can.signals.table_accel: found"));
    }
}

TEST_F(CandumpCampaign, WithoutAConfigurationHasTheSignalsOfTheRig) {
    EXPECT_EQ(read("", "").samples[10].of(Channel::table_accel), Quality::good);
    EXPECT_EQ(read("can.sample_rate_hz = 40.0\n", "").samples[10].of(Channel::table_accel),
              Quality::good);
}

}  // namespace
}  // namespace vibrig::record
