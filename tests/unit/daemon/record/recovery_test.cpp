#include <gtest/gtest.h>

#include <string>

#include "daemon/record/campaign_file.hpp"
#include "tests/unit/daemon/record/recording.hpp"

namespace vibrig::record {
namespace {

TEST_F(Recording, OfAWriterThatDiedIsMendedOnce) {
    // GIVEN what is on the disk while a campaign is written
    const std::string path = (folder_ / "campaign.h5").string();
    {
        CampaignWriter writer((folder_ / "living.h5").string(), head());
        for (const auto& sample : samples(500, 0)) writer.put(sample);
        put_order(writer, 3, 2 * drivers::kSecond, 100 * drivers::kSecond);
        writer.commit();
        EXPECT_THROW(static_cast<void>(recover((folder_ / "living.h5").string(), {})),
                     std::runtime_error);
        fs::copy_file(folder_ / "living.h5", path);
    }
    // WHEN it is mended
    const Recovery recovery = recover(path, {}).at(0);
    // THEN it says what there is and what is lost
    EXPECT_FALSE(recovery.was_closed);
    EXPECT_EQ(recovery.samples, 500U);
    EXPECT_EQ(recovery.cut_dwell, "run 1 position 3: 420 samples, 10.475 of 98.000 s, are there");
    const Campaign read = read_campaign(path);
    EXPECT_EQ(read.state, "recovered");
    EXPECT_EQ(read.samples.size(), 500U);
    ASSERT_EQ(read.gaps.size(), 1U);
    EXPECT_EQ(read.gaps[0].stream, "end");
    // AND a second time there is nothing to do
    const std::string bytes = file(path);
    const Recovery again = recover(path, {}).at(0);
    EXPECT_TRUE(again.was_closed);
    EXPECT_TRUE(again.recovered);
    EXPECT_EQ(again.cut_dwell, recovery.cut_dwell);
    EXPECT_EQ(again.words, recovery.words);
    EXPECT_EQ(file(path), bytes);
}

TEST_F(Recording, OfWhichTheLastPartDiedIsMendedFromWithinItsFolderToo) {
    // GIVEN a campaign that went on in a second file, whose writer died
    const fs::path folder = folder_ / "test-1";
    fs::create_directories(folder);
    Head of = head();
    of.campaign = "test-1";
    {
        CampaignWriter writer((folder / "campaign.h5").string(), of);
        for (const auto& sample : samples(500, 0)) writer.put(sample);
        writer.end({kContinued, "", "", "", of.utc_ns});
    }
    of.part = 2;
    {
        CampaignWriter writer((folder_ / "living.h5").string(), of);
        for (const auto& sample : samples(500, 100 * drivers::kSecond)) writer.put(sample);
        writer.commit();
        fs::copy_file(folder_ / "living.h5", folder / "campaign-2.h5");
    }
    // WHEN its first file is named without a folder, and as somebody types it
    const fs::path back = fs::current_path();
    fs::current_path(folder);
    const Recovery recovery = recover("campaign.h5", {}).at(0);
    fs::current_path(back);
    // THEN the part that died is mended
    EXPECT_FALSE(recovery.was_closed);
    EXPECT_EQ(recovery.parts, 2U);
    EXPECT_EQ(recovery.samples, 1000U);
    EXPECT_EQ(read_campaign(folder.string() + "//campaign.h5").state, "recovered");
}

TEST_F(Recording, WithoutItsHdf5FileIsNamed) {
    // GIVEN a campaign, and a folder of which the raw log alone is left
    const fs::path one = folder_ / "one", gone = folder_ / "gone";
    for (const auto& path : {one, gone}) fs::create_directories(path);
    {
        CampaignWriter writer((one / "campaign.h5").string(), head());
        for (const auto& sample : samples(500, 0)) writer.put(sample);
        writer.end({"finished", "", "", "{}", head().utc_ns});
    }
    std::ofstream(gone / "raw-0001.log") << "(1767225600.000000) vcan0 123#00 R\n";
    std::ofstream(gone / "dwells.csv") << "\n";
    fs::create_directories(folder_ / "of nobody");
    // WHEN all are mended, THEN it is named as one that cannot be
    const auto found = recover(folder_.string(), [](const std::string&) {});
    ASSERT_EQ(found.size(), 2U);
    EXPECT_EQ(found[0].path, gone.string());
    EXPECT_NE(found[0].failed.find("gone: found no campaign.h5 in it"), std::string::npos)
        << found[0].failed;
    EXPECT_NE(found[0].failed.find("vibrig replay " + gone.string() + "/raw-*"), std::string::npos)
        << found[0].failed;
    EXPECT_EQ(found[1].failed, "");
    EXPECT_THROW(static_cast<void>(recover(gone.string(), {})), std::runtime_error);
    // AND a log in another's place is named of the whole one
    for (const char* name : {"raw-0001.log", "raw-0002.log"})
        std::ofstream(one / name) << "(1767225600.000000) vcan0 123#00 R\n"
                                     "(1767225660.000000) vcan0 123#00 R\n";
    EXPECT_NE(
        recover(one.string(), {}).at(0).misplaced_raw.find("raw-0002.log: found a time 60.00"),
        std::string::npos);
}

}  // namespace
}  // namespace vibrig::record
