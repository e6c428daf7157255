#include "proto/durable_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>

namespace vibrig::proto {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class DurableFile : public ::testing::Test {
  protected:
    void SetUp() override { fs::create_directories(folder); }
    void TearDown() override { fs::remove_all(folder); }
    static std::string text_of(const fs::path& path) {
        std::ifstream file(path);
        return {std::istreambuf_iterator<char>(file), {}};
    }
    static struct stat of(const fs::path& path) {
        struct stat found {};
        EXPECT_EQ(::lstat(path.c_str(), &found), 0);
        return found;
    }
    const fs::path folder =
        fs::path(::testing::TempDir()) / ("durable" + std::to_string(::getpid()));
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

}  // namespace
}  // namespace vibrig::proto
