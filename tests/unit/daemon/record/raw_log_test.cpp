#include "daemon/record/raw_log.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <string>
#include <vector>

#include "daemon/record/campaign_file.hpp"
#include "tests/unit/daemon/record/recording.hpp"

namespace vibrig::record {
namespace {

TEST_F(Recording, OfFramesIsACandumpLogInSegmentsThatAreCompressed) {
    configuration::RecordSettings settings;
    settings.segment_s = 1;
    std::vector<Segment> closed;
    RawLog log(folder_.string(), "vcan0", settings, 1'700'000'000 * drivers::kSecond,
               [&closed](const Segment& segment) { closed.push_back(segment); });
    // GIVEN frames of both directions over more than two segments
    for (int i = 0; i < 25; ++i) {
        log.add(frame(0x101, i * 100 * drivers::kMillisecond + 123'456'000, i % 5 == 4));
        log.flush();
    }
    log.close();
    // THEN the segments hold them all, in order and as candump writes them
    ASSERT_EQ(closed.size(), 3U);
    const auto files = raw_files(folder_.string());
    ASSERT_EQ(files.size(), 3U);
    std::string text;
    for (const auto& name : files) {
        EXPECT_TRUE(name.ends_with(".log.zst")) << name;
        read_raw(name, [&text](std::string_view piece) {
            text += piece;
            return true;
        });
    }
    EXPECT_EQ(std::ranges::count(text, '\n'), 25);
    EXPECT_TRUE(text.starts_with("(1700000000.123456) vcan0 101#AB01 R\n")) << text.substr(0, 80);
    EXPECT_NE(text.find("(1700000000.523456) vcan0 101#AB01 T\n"), std::string::npos);
    EXPECT_EQ(log.frames(), 25U);
    EXPECT_EQ(log.lost(), 0U);
}

TEST_F(Recording, OfFramesCountsWhatTheDiskRefusesAndGoesOnWhenItDoesNot) {
    // GIVEN a folder that is not there
    const fs::path gone = folder_ / "gone";
    RawLog log(gone.string(), "vcan0", configuration::RecordSettings{}, 0, {});
    for (int i = 0; i < 3; ++i) log.add(frame(1, i * drivers::kSecond));
    log.flush();
    Gap gap;
    EXPECT_FALSE(log.good());
    EXPECT_EQ(log.lost(), 3U);
    EXPECT_FALSE(log.take_gap(gap)) << "nobody could read it yet";
    // WHEN it comes back, and the time to try again has come
    fs::create_directory(gone);
    for (int i = 0; i < 100 && !log.good(); ++i) {
        log.add(frame(1, (10 + i) * drivers::kSecond));
        log.flush();
        ::usleep(50'000);
    }
    // THEN it writes, and tells what is missing
    EXPECT_TRUE(log.good());
    ASSERT_TRUE(log.take_gap(gap));
    EXPECT_EQ(gap.lost, log.lost());
    EXPECT_GE(gap.lost, 3U);
    EXPECT_EQ(gap.from, 0);
    EXPECT_NE(gap.reason.find("gone"), std::string::npos) << gap.reason;
    EXPECT_FALSE(log.take_gap(gap));
}

}  // namespace
}  // namespace vibrig::record
