#include "daemon/record/disk.hpp"
#include "tests/unit/support/temporary_folder.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

namespace vibrig::record {
namespace {

/// Whether somebody who may only read it sees that it is held.
bool seen_by_a_reader(const std::string& path) {
    const pid_t child = ::fork();
    if (child == 0) {
        if (::geteuid() == 0 && ::setuid(65534) != 0) ::_exit(2);
        ::_exit(WriterLock::held(path) ? 0 : 1);
    }
    int status = -1;
    ::waitpid(child, &status, 0);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) < 2) << status;
    return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

TEST(WriterLock, IsSeenByWhoMayOnlyRead) {
    const TemporaryFolder folder;
    const std::string path = folder.file("campaign.h5");
    std::ofstream(path) << "rows";
    {
        const WriterLock lock(path);
        ASSERT_EQ(::chmod(folder.c_str(), 0755), 0);
        ASSERT_EQ(::chmod(path.c_str(), 0444), 0);
        EXPECT_TRUE(WriterLock::held(path));
        EXPECT_TRUE(seen_by_a_reader(path));
    }
    EXPECT_FALSE(seen_by_a_reader(path));
}

}  // namespace
}  // namespace vibrig::record
