#include "daemon/serve/socket_file.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <thread>
#include <vector>

#include "daemon/serve/status_server.hpp"
#include "tests/unit/daemon/serve/fake_source.hpp"
#include "tests/unit/daemon/serve/raw_connection.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::serve {
namespace {

/// What a killed daemon leaves: a socket's file with nobody behind it.
void leave_stale(const std::string& path) {
    const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.copy(address.sun_path, sizeof address.sun_path - 1);
    ASSERT_EQ(::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    ASSERT_EQ(::listen(fd, 1), 0);
    ::close(fd);
}

std::string refusal_of(const std::string& path) {
    try {
        const SocketFile file(path);
    } catch (const ServeError& error) {
        return error.what();
    }
    return "none";
}

TEST(SocketFile, TakesOverTheSocketOfADeadDaemon) {
    const TemporaryFolder folder;
    const std::string path = folder.file("s");
    leave_stale(path);
    FakeSource source;
    const StatusServer server(source, path);
    EXPECT_EQ(status_of(get(path, "/healthz")), 200);
}

TEST(SocketFile, LeavesALiveDaemonAlone) {
    const TemporaryFolder folder;
    const std::string path = folder.file("s");
    FakeSource source;
    const StatusServer server(source, path);
    EXPECT_EQ(refusal_of(path), "another vibrigd answers at " + path);
    EXPECT_EQ(status_of(get(path, "/healthz")), 200);
}

TEST(SocketFile, NeverRemovesAFileThatIsNoSocket) {
    const TemporaryFolder folder;
    const std::string path = folder.file("precious");
    std::ofstream(path) << "data";
    EXPECT_NE(refusal_of(path).find("is no socket"), std::string::npos);
    EXPECT_TRUE(std::filesystem::exists(path));
    std::filesystem::create_symlink(path, folder.file("link"));
    EXPECT_NE(refusal_of(folder.file("link")).find("is no socket"), std::string::npos);
}

TEST(SocketFile, NamesThePathAndTheCause) {
    EXPECT_NE(refusal_of("").find("server.socket: found ''"), std::string::npos);
    EXPECT_NE(refusal_of("/tmp/" + std::string(200, 'x')).find("205 bytes"), std::string::npos);
    const std::string nowhere = "/nonexistent-folder/vibrigd.sock";
    EXPECT_NE(refusal_of(nowhere).find(nowhere + ": cannot open its folder: No such file"),
              std::string::npos)
        << refusal_of(nowhere);
}

TEST(SocketFile, IsForUserAndGroupOnlyAndGoesWithItsOwner) {
    const TemporaryFolder folder;
    const std::string path = folder.file("s");
    {
        const mode_t before = ::umask(0);
        const SocketFile file(path);
        ::umask(before);
        struct stat found {};
        ASSERT_EQ(::lstat(path.c_str(), &found), 0);
        EXPECT_EQ(found.st_mode & 0777u, 0660u);
    }
    EXPECT_FALSE(std::filesystem::exists(path));
}

TEST(SocketFile, OfASuccessorIsNotRemoved) {
    const TemporaryFolder folder;
    const std::string path = folder.file("s");
    {
        const SocketFile file(path);
        std::filesystem::rename(path, folder.file("moved"));
        leave_stale(path);
    }
    EXPECT_TRUE(std::filesystem::exists(path));
}

TEST(SocketFile, GoesToOneOfManyThatStartTogether) {
    const TemporaryFolder folder;
    const std::string path = folder.file("s");
    for (int round = 0; round < 20; ++round) {
        leave_stale(path);
        std::atomic<int> won = 0;
        std::vector<std::unique_ptr<SocketFile>> files(4);
        {
            std::vector<std::jthread> starters;
            for (auto& file : files) {
                starters.emplace_back([&file, &path, &won] {
                    try {
                        file = std::make_unique<SocketFile>(path);
                        ++won;
                    } catch (const ServeError&) {
                    }
                });
            }
        }
        EXPECT_EQ(won, 1) << "round " << round;
    }
}

}  // namespace
}  // namespace vibrig::serve
