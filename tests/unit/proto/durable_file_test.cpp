#include "proto/durable_file.hpp"
#include "tests/unit/support/temporary_folder.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <iterator>

namespace vibrig::proto {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class DurableFile : public ::testing::Test {
  protected:
    static std::string text_of(const fs::path& path) {
        std::ifstream file(path);
        return {std::istreambuf_iterator<char>(file), {}};
    }
    static struct stat of(const fs::path& path) {
        struct stat found {};
        EXPECT_EQ(::lstat(path.c_str(), &found), 0);
        return found;
    }
    TemporaryFolder folder;
    const fs::path file = folder / "rig.toml";
};

TEST_F(DurableFile, ANewOneIsOfTheModeAskedAndNothingElseIsLeft) {
    write_durably(file.string(), "one\n", 0600);
    EXPECT_EQ(text_of(file), "one\n");
    EXPECT_EQ(of(file).st_mode & 0777U, 0600U);
    EXPECT_EQ(std::distance(fs::directory_iterator(folder), {}), 1);
}

TEST_F(DurableFile, TheOldOnesModeAndOwnerAreKept) {
    write_durably(file.string(), "one\n", 0644);
    ASSERT_EQ(::chmod(file.c_str(), 0604), 0);
    // Who is not root keeps its own.
    if (::geteuid() == 0) {
        ASSERT_EQ(::chown(file.c_str(), 65534, 65534), 0);
    }
    const auto before = of(file);
    write_durably(file.string(), "two\n", 0644);
    EXPECT_EQ(text_of(file), "two\n");
    EXPECT_EQ(of(file).st_mode, before.st_mode);
    EXPECT_EQ(of(file).st_uid, before.st_uid);
    EXPECT_EQ(of(file).st_gid, before.st_gid);
}

TEST_F(DurableFile, ALinkStaysALink) {
    fs::create_directories(folder / "real");
    write_durably((folder / "real" / "rig.toml").string(), "one\n");
    fs::create_symlink("real/rig.toml", file);
    write_durably(file.string(), "two\n");
    EXPECT_TRUE(fs::is_symlink(file));
    EXPECT_EQ(text_of(folder / "real" / "rig.toml"), "two\n");
}

TEST_F(DurableFile, WhatCannotBeWrittenIsNamedAndTheOldOneStays) {
    const fs::path nowhere = folder / "none" / "rig.toml";
    try {
        write_durably(nowhere.string(), "one\n");
        FAIL();
    } catch (const std::runtime_error& error) {
        EXPECT_THAT(error.what(), HasSubstr("rig.toml.new: cannot be written: No such file"));
    }
    write_durably(file.string(), "one\n");
    fs::create_directories(file.string() + ".new");  // in the way
    EXPECT_THROW(write_durably(file.string(), "two\n"), std::runtime_error);
    EXPECT_EQ(text_of(file), "one\n");
}

TEST_F(DurableFile, AnOutputTakesTheOldOnesPlaceOnceItIsWhole) {
    std::ofstream(file) << "good\n";
    ASSERT_EQ(::chmod(file.c_str(), 0604), 0);
    // WHEN one is written and not finished, THEN the old one is what it was, and alone
    {
        const OutputFile out(file.string());
        std::ofstream(out.place()) << "half";
        EXPECT_EQ(text_of(file), "good\n");
    }
    EXPECT_EQ(text_of(file), "good\n");
    EXPECT_EQ(std::distance(fs::directory_iterator(folder), {}), 1);
    // WHEN it is finished, through a link
    fs::create_symlink("rig.toml", folder / "link");
    write_output((folder / "link").string(), "whole\n");
    // THEN it has the name and the mode, and the link is one
    EXPECT_EQ(text_of(file), "whole\n");
    EXPECT_EQ(of(file).st_mode & 0777U, 0604U);
    EXPECT_TRUE(fs::is_symlink(folder / "link"));
    EXPECT_EQ(std::distance(fs::directory_iterator(folder), {}), 2);
}

TEST_F(DurableFile, DevicesAndPipesAreWrittenAsTheyAre) {
    write_output("/dev/null", "text");
    EXPECT_TRUE(fs::is_character_file("/dev/null"));
    EXPECT_THROW(write_output("/dev/full", "text"), std::runtime_error);
    // A descriptor leads to the file that it has open.
    std::ofstream(file) << "long and old\n";
    const auto before = of(file);
    const int open = ::open(file.c_str(), O_RDWR);
    for (const char* const at : {"/dev/fd/", "/proc/self/fd/"}) {
        fs::create_symlink(at + std::to_string(open), folder / "link");
        write_output((folder / "link").string(), at);
        EXPECT_EQ(text_of(file), at);
        EXPECT_EQ(of(file).st_ino, before.st_ino) << "another may have it open";
        fs::remove(folder / "link");
    }
    ::close(open);
    ASSERT_EQ(::mkfifo((folder / "pipe").c_str(), 0600), 0);
    const int reader = ::open((folder / "pipe").c_str(), O_RDONLY | O_NONBLOCK);
    write_output((folder / "pipe").string(), "text");
    std::array<char, 8> got{};
    EXPECT_EQ(::read(reader, got.data(), got.size()), 4);
    ::close(reader);
    EXPECT_TRUE(fs::is_fifo(folder / "pipe"));
}

TEST_F(DurableFile, RecordingsAndInputsAreNoOutputs) {
    const auto refused = [](const fs::path& path) -> std::string {
        try {
            write_output(path.string(), "text");
        } catch (const std::runtime_error& error) {
            return error.what();
        }
        return "";
    };
    const auto put = [&](const char* name, const std::string& text) {
        std::ofstream(folder / name, std::ios::binary) << text;
        return folder / name;
    };
    // GIVEN files that are not a campaign's by their folder, THEN the content says it
    EXPECT_EQ(refused(put("raw-0001.log", "")), "");
    for (const auto& path : {put("other.bin", "\x89HDF\r\n\x1a\n and more"),
                             put("j.db", "SQLite format 3 and more")}) {
        const std::string text = text_of(path);
        EXPECT_THAT(refused(path), HasSubstr(path.string() + ": found a file of a recording"));
        EXPECT_EQ(text_of(path), text);
    }
    // GIVEN a campaign, also by a link
    put("campaign.h5", "cut off");
    fs::create_symlink("campaign.h5", folder / "chart.svg");
    for (const char* const name :
         {"campaign.h5", "chart.svg", "raw-0001.log", "dwells.csv", "recordings.sqlite3"}) {
        if (!fs::exists(folder / name)) put(name, "");
        EXPECT_THAT(refused(folder / name), HasSubstr("found a file of a recording")) << name;
    }
    // AND names that a new file would be taken for
    for (const char* const name :
         {"raw-0009.log", "campaign-2.h5", "archive.json", "j.sqlite3-wal"}) {
        EXPECT_THAT(refused(folder / name), HasSubstr("found the name of a recording's file"));
        EXPECT_FALSE(fs::exists(folder / name)) << name;
    }
    EXPECT_EQ(refused(folder / "report.html"), "");
    // GIVEN an input, by another name
    put("rec.csv", "rows");
    fs::create_hard_link(folder / "rec.csv", folder / "same.csv");
    name_inputs({"none", (folder / "same.csv").string()});
    EXPECT_THAT(refused(folder / "rec.csv"), HasSubstr("rec.csv: found a file that the command"));
    EXPECT_EQ(text_of(folder / "rec.csv"), "rows");
    name_inputs({});
    EXPECT_EQ(refused(folder / "rec.csv"), "");
}

}  // namespace
}  // namespace vibrig::proto
