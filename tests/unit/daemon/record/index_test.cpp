#include "daemon/record/index.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/journal/database.hpp"
#include "daemon/record/digest.hpp"
#include "daemon/record/raw_log.hpp"
#include "tests/unit/daemon/record/parts.hpp"

namespace vibrig::record {
namespace {

TEST_F(Parts, AreFoundInAnIndexThatWasCutToNothing) {
    write(head(1), 10 * kSecond, {1}, 1, "finished");
    std::vector<std::string> reported;
    const auto tell = [&reported](const std::string& words) { reported.push_back(words); };
    // One that is not there yet is not empty.
    EXPECT_TRUE(Index(recordings_.string(), tell).campaigns().empty());
    EXPECT_TRUE(reported.empty());
    const std::string path = Index::path_in(recordings_.string());
    for (const char* end : {"", "-wal", "-shm"}) fs::remove(path + end);
    std::ofstream(path).flush();
    EXPECT_EQ(Index(recordings_.string(), tell).campaigns().size(), 1U);
    ASSERT_EQ(reported.size(), 1U);
    EXPECT_NE(reported[0].find("is empty: made anew from the files of 1 campaigns"),
              std::string::npos)
        << reported[0];
}

TEST_F(Parts, AreFoundAmongManyAndInAnIndexThatIsDamaged) {
    // GIVEN one campaign that is there, and many more in the index
    write(head(1), 10 * kSecond, {1}, 1, "finished");
    std::vector<std::string> reported;
    const auto tell = [&reported](const std::string& words) { reported.push_back(words); };
    Index(recordings_.string(), tell).note(folder_.string());
    const std::string path = Index::path_in(recordings_.string());
    {
        journal::Database database(path);
        database.execute("BEGIN");
        for (int i = 0; i < 20'000; ++i) {
            const std::string key = "other-" + std::to_string(i);
            database.run("INSERT INTO campaign VALUES (?, 'other', 'A. Person', ?, 'finished')",
                         {std::string_view(key), std::int64_t{i}});
        }
        database.execute("COMMIT");
    }
    // THEN it is found by key and by name, and what is not is reported with some that are
    EXPECT_EQ(find_campaign("test", {recordings_.string()}, tell), folder_.string());
    EXPECT_EQ(find_campaign("other-19999", {recordings_.string()}, tell),
              (recordings_ / "other-19999").string());
    try {
        static_cast<void>(find_campaign("tset", {recordings_.string()}, tell));
        FAIL() << "found";
    } catch (const std::runtime_error& error) {
        EXPECT_NE(std::string(error.what()).find("other-11 ..."), std::string::npos)
            << error.what();
    }
    EXPECT_TRUE(reported.empty());
    // WHEN pages that opening does not read are overwritten
    {
        std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
        file.seekp(16 * 4096);
        file << std::string(fs::file_size(path) - 16 * 4096, 'x');
    }
    // THEN it is made anew from the files, and reported
    EXPECT_EQ(find_campaign("test", {recordings_.string()}, tell), folder_.string());
    ASSERT_EQ(reported.size(), 1U);
    EXPECT_NE(reported[0].find("made anew from the files of 1 campaigns"), std::string::npos)
        << reported[0];
}

TEST_F(Parts, AreInTheIndexWithTimesSizesAndHashes) {
    write(head(1), 10 * kSecond, {1}, 1, "continued");
    write(head(2), 100 * kSecond, {2}, 1);
    std::vector<std::string> reported;
    const auto tell = [&reported](const std::string& words) { reported.push_back(words); };
    {
        Index index(recordings_.string(), tell);
        EXPECT_TRUE(index.campaigns().empty());
        index.note(folder_.string());
    }
    const auto campaigns = Index(recordings_.string(), tell).campaigns();
    ASSERT_EQ(campaigns.size(), 1U);
    EXPECT_EQ(campaigns[0].key, "test-1");
    EXPECT_EQ(campaigns[0].state, "finished");
    ASSERT_EQ(campaigns[0].files.size(), 2U);
    const auto& file = campaigns[0].files[0];
    EXPECT_EQ(file.name, "campaign-2.h5");
    EXPECT_TRUE(file.closed);
    EXPECT_EQ(file.rows, 400);
    EXPECT_EQ(file.from_utc_ns, 1'700'000'100 * kSecond);
    EXPECT_EQ(file.to_utc_ns, 1'700'000'100 * kSecond + 399 * kStep);
    EXPECT_EQ(file.bytes, static_cast<std::int64_t>(fs::file_size(folder_ / file.name)));
    EXPECT_EQ(file.sha256, sha256_of_file((folder_ / file.name).string()));
    // WHEN a campaign is asked for by its name, THEN it is found
    EXPECT_EQ(find_campaign("test", {recordings_.string()}, tell), folder_.string());
    EXPECT_EQ(find_campaign("test-1", {recordings_.string()}, tell), folder_.string());
    EXPECT_THROW(static_cast<void>(find_campaign("tset", {recordings_.string()}, tell)),
                 std::runtime_error);
    EXPECT_TRUE(reported.empty());
    // WHEN the last part is gone, THEN the index knows it
    fs::remove(folder_ / "campaign-2.h5");
    EXPECT_THROW(compare_with_index(folder_.string(), tell), std::runtime_error);
}

TEST_F(Parts, ARawLogThatBeginsBeforeTheEndOfTheOneBeforeItIsNamed) {
    const auto put = [this](int number, const std::string& text) {
        std::ofstream(folder_ / ("raw-000" + std::to_string(number) + ".log")) << text;
    };
    const auto frames = [](int from_s, int to_s) {
        std::string text;
        for (int s = from_s; s <= to_s; ++s)
            text += "(" + std::to_string(1'700'000'000 + s) + ".000000) vcan0 123#00 R\n";
        return text;
    };
    EXPECT_EQ(misplaced_raw(folder_.string()), "");
    put(1, frames(0, 50));
    put(2, frames(50, 100));  // at the same time: stamps are not quite in order
    put(3, "");
    put(4, frames(100, 150));
    EXPECT_EQ(misplaced_raw(folder_.string()), "");
    // A copy of another one, or of another campaign.
    put(4, frames(0, 50));
    EXPECT_NE(misplaced_raw(folder_.string()).find("raw-0004.log: found a time 100.00 s before"),
              std::string::npos)
        << misplaced_raw(folder_.string());
    put(4, frames(100, 150));
    put(2, frames(150, 200));
    EXPECT_NE(misplaced_raw(folder_.string()).find("raw-0004.log: found a time 100.00 s before"),
              std::string::npos)
        << misplaced_raw(folder_.string());
    // After a start UTC may have been set back.
    put(4, std::string(kStartLine) + "\n" + frames(100, 150));
    EXPECT_EQ(misplaced_raw(folder_.string()), "");
}

TEST_F(Parts, AreFoundAgainWhenTheIndexIsDamaged) {
    write(head(1), 10 * kSecond, {1}, 1);
    std::ofstream(Index::path_in(recordings_.string())) << std::string(5000, 'x');
    std::vector<std::string> reported;
    const auto tell = [&reported](const std::string& words) { reported.push_back(words); };
    EXPECT_EQ(find_campaign("test", {recordings_.string()}, tell), folder_.string());
    ASSERT_EQ(reported.size(), 1U);
    EXPECT_NE(reported[0].find("made anew from the files of 1 campaigns"), std::string::npos)
        << reported[0];
    EXPECT_EQ(find_campaign("test", {recordings_.string()}, tell), folder_.string());
    EXPECT_EQ(reported.size(), 1U);
}

}  // namespace
}  // namespace vibrig::record
