#include "daemon/guard/meeting.hpp"
#include "tests/unit/support/temporary_folder.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

namespace vibrig::guard {
namespace {

/// A daemon's end.
class Caller {
  public:
    explicit Caller(const std::string& path)
        : fd_(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0)) {
        sockaddr_un address{};
        address.sun_family = AF_UNIX;
        path.copy(address.sun_path, sizeof(address.sun_path) - 1);
        connected =
            ::connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
    }
    ~Caller() { ::close(fd_); }
    Caller(const Caller&) = delete;
    Caller& operator=(const Caller&) = delete;
    template <std::size_t N>
    void say(const std::array<std::uint8_t, N>& bytes) const {
        ASSERT_EQ(::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL), ssize_t{N});
    }
    [[nodiscard]] std::optional<proto::GuardWord> hear() const {
        std::array<std::uint8_t, 100> bytes{};
        const ssize_t size = ::recv(fd_, bytes.data(), bytes.size(), MSG_DONTWAIT);
        if (size <= 0) return {};
        return proto::decode_guard_word({bytes.data(), static_cast<std::size_t>(size)});
    }
    bool connected = false;

  private:
    int fd_;
};

proto::DaemonWord word_of(std::uint64_t sequence) {
    proto::DaemonWord word;
    word.sequence = sequence;
    return word;
}

TEST(Meeting, TakesTheNewestWordAndAnswers) {
    const TemporaryFolder folder;
    Meeting meeting(folder.file("guard.sock"));
    EXPECT_FALSE(meeting.attend(1));
    const Caller caller(folder.file("guard.sock"));
    ASSERT_TRUE(caller.connected);
    for (std::uint64_t i = 1; i <= 5; ++i) caller.say(proto::encode(word_of(i)));
    EXPECT_TRUE(meeting.attend(7));
    EXPECT_EQ(meeting.word()->sequence, 5u);
    EXPECT_EQ(meeting.heard(), 7);
    proto::GuardWord answer;
    answer.sequence = 5;
    meeting.tell(answer);
    EXPECT_EQ(caller.hear(), answer);
}

TEST(Meeting, WhatIsNoWordIsCountedAndNotHeard) {
    const TemporaryFolder folder;
    Meeting meeting(folder.file("guard.sock"));
    const Caller caller(folder.file("guard.sock"));
    caller.say(std::array<std::uint8_t, 3>{1, 2, 3});
    caller.say(std::array<std::uint8_t, 80>{});
    caller.say(proto::encode(proto::GuardWord{}));
    EXPECT_FALSE(meeting.attend(1));
    EXPECT_EQ(meeting.refused(), 3u);
    EXPECT_FALSE(meeting.word());
    caller.say(proto::encode(word_of(1)));
    EXPECT_TRUE(meeting.attend(2));
}

TEST(Meeting, ANewDaemonTakesThePlaceOfTheOld) {
    const TemporaryFolder folder;
    Meeting meeting(folder.file("guard.sock"));
    const Caller old(folder.file("guard.sock"));
    old.say(proto::encode(word_of(10)));
    EXPECT_TRUE(meeting.attend(1));
    const Caller fresh(folder.file("guard.sock"));
    fresh.say(proto::encode(word_of(1)));
    EXPECT_TRUE(meeting.attend(2));
    EXPECT_EQ(meeting.word()->sequence, 1u);
    meeting.tell({});
    EXPECT_TRUE(fresh.hear());
    EXPECT_FALSE(old.hear());
}

TEST(Meeting, TheLastWordIsKeptWhenTheDaemonHasGone) {
    const TemporaryFolder folder;
    Meeting meeting(folder.file("guard.sock"));
    {
        const Caller caller(folder.file("guard.sock"));
        caller.say(proto::encode(word_of(3)));
    }
    EXPECT_TRUE(meeting.attend(1));
    EXPECT_FALSE(meeting.connected());
    EXPECT_EQ(meeting.word()->sequence, 3u);
    EXPECT_FALSE(meeting.attend(2));
    EXPECT_EQ(meeting.heard(), 1);
}

TEST(Meeting, AFloodDoesNotHoldUpTheLoop) {
    const TemporaryFolder folder;
    Meeting meeting(folder.file("guard.sock"));
    const Caller caller(folder.file("guard.sock"));
    for (std::uint64_t i = 1; i <= 100; ++i) caller.say(proto::encode(word_of(i)));
    EXPECT_TRUE(meeting.attend(1));
    EXPECT_EQ(meeting.word()->sequence, 64u);
}

TEST(Meeting, APlaceLeftBehindIsTakenOverAndOneInUseIsNot) {
    const TemporaryFolder folder;
    const auto path = folder.file("guard.sock");
    {
        // GIVEN what a killed guard leaves behind
        const int fd = ::socket(AF_UNIX, SOCK_SEQPACKET, 0);
        sockaddr_un address{};
        address.sun_family = AF_UNIX;
        path.copy(address.sun_path, sizeof(address.sun_path) - 1);
        ASSERT_EQ(::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
        ::close(fd);
    }
    {
        Meeting meeting(path);
        struct stat status {};
        ASSERT_EQ(::stat(path.c_str(), &status), 0);
        EXPECT_EQ(status.st_mode & 0777U, 0660U) << "nobody else may knock";
        EXPECT_THROW(Meeting{path}, std::runtime_error);
        const Caller caller(path);
        EXPECT_TRUE(caller.connected) << "the first is not disturbed";
    }
    EXPECT_NE(::access(path.c_str(), F_OK), 0) << "nothing is left behind";
}

}  // namespace
}  // namespace vibrig::guard
