#include "daemon/app/result_files.hpp"
#include "tests/unit/support/temporary_folder.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <vector>

namespace vibrig {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;

class ResultFilesTest : public ::testing::Test {
  protected:
    ResultFiles files() {
        return {folder_.string(), [this](Severity severity, const std::string& text) {
                    if (severity == Severity::alarm) alarms_.push_back(text);
                }};
    }
    void written_at(const char* name, std::time_t time) {
        const timespec at{time, 0};
        const timespec both[] = {at, at};
        ASSERT_EQ(::utimensat(AT_FDCWD, (folder_ / name).c_str(), both, 0), 0);
    }
    std::string content(const char* name) const {
        std::ostringstream text;
        text << std::ifstream(folder_ / name).rdbuf();
        return text.str();
    }
    std::vector<std::string> names() const {
        std::vector<std::string> found;
        for (const auto& entry : std::filesystem::directory_iterator(folder_))
            found.push_back(entry.path().filename().string());
        return found;
    }

    TemporaryFolder folder_;
    std::vector<std::string> alarms_;
};

TEST_F(ResultFilesTest, OfYesterdayDoNotStandBesideThePartialOneOfTonight) {
    auto of = files();
    of.write("yesterday", true);
    written_at("result.json", 1772352000);  // 2026-03-01 08:00:00
    of.begin();
    EXPECT_THAT(names(), ElementsAre("result-20260301T080000Z.json"));
    of.write("tonight", false);
    EXPECT_THAT(names(),
                UnorderedElementsAre("result-20260301T080000Z.json", "result-partial.json"));
    EXPECT_EQ(content("result-20260301T080000Z.json"), "yesterday");
    EXPECT_THAT(alarms_, IsEmpty());
}

TEST_F(ResultFilesTest, OfOneSecondAreAllKept) {
    auto of = files();
    for (const char* text : {"one", "two", "three"}) {
        of.write(text, false);
        written_at("result-partial.json", 1772352000);
        of.begin();
    }
    EXPECT_EQ(content("result-partial-20260301T080000Z.json"), "one");
    EXPECT_EQ(content("result-partial-20260301T080000Z-2.json"), "two");
    EXPECT_EQ(content("result-partial-20260301T080000Z-3.json"), "three");
}

TEST_F(ResultFilesTest, ThatCannotBeWrittenRaiseAnAlarm) {
    ResultFiles of((folder_ / "missing").string(),
                   [this](Severity, const std::string& text) { alarms_.push_back(text); });
    of.begin();
    EXPECT_THAT(alarms_, IsEmpty());
    of.write("text", true);
    EXPECT_THAT(alarms_, ElementsAre(AllOf(HasSubstr("cannot write "),
                                           HasSubstr("result.json: No such file or directory"))));
}

/// As of a disk that was full at the campaign's end.
TEST_F(ResultFilesTest, ComeOnceTheDiskTakesThem) {
    const auto later = [](int s) {
        return std::chrono::steady_clock::now() + std::chrono::seconds(s);
    };
    const std::filesystem::path link = folder_ / "result.json.new";
    std::filesystem::create_symlink("/dev/full", link);
    auto of = files();
    of.write("tonight", true);
    EXPECT_THAT(alarms_, ElementsAre(HasSubstr("No space left on device")));
    EXPECT_THAT(names(), IsEmpty()) << "and nothing half done";
    std::filesystem::create_symlink("/dev/full", link);
    of.try_again(later(2));
    EXPECT_THAT(names(), IsEmpty());
    of.try_again(later(2));
    EXPECT_THAT(names(), IsEmpty()) << "once a second";
    of.try_again(later(4));
    EXPECT_EQ(content("result.json"), "tonight");
    EXPECT_EQ(alarms_.size(), 1U);
    // It is written once, and not for the campaign that comes next.
    std::filesystem::remove(folder_ / "result.json");
    of.try_again(later(6));
    EXPECT_THAT(names(), IsEmpty());
    std::filesystem::create_symlink("/dev/full", link);
    of.write("tonight", true);
    of.begin();
    of.try_again(later(8));
    EXPECT_THAT(names(), IsEmpty());
}

TEST_F(ResultFilesTest, AreNoneWithoutAFolder) {
    ResultFiles of("", [this](Severity, const std::string& text) { alarms_.push_back(text); });
    of.begin();
    of.write("text", true);
    EXPECT_THAT(alarms_, IsEmpty());
}

}  // namespace
}  // namespace vibrig
