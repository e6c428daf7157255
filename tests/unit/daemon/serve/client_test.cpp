#include "daemon/serve/client.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "tests/unit/daemon/serve/raw_connection.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::serve {
namespace {

using namespace std::chrono_literals;

/// A door whose queue is full: nobody has taken those who wait in it.
class FullDoor {
  public:
    explicit FullDoor(const std::string& path) {
        path.copy(address_.sun_path, sizeof address_.sun_path - 1);
        EXPECT_EQ(::bind(listener_, generic(), sizeof address_), 0);
        EXPECT_EQ(::listen(listener_, 0), 0);
        // Who does not come is not waited for without end.
        const timeval longest{10, 0};
        ::setsockopt(listener_, SOL_SOCKET, SO_RCVTIMEO, &longest, sizeof longest);
        for (;;) {
            const int one = ::socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
            waiting_.push_back(one);
            if (::connect(one, generic(), sizeof address_) != 0) break;
        }
        EXPECT_EQ(errno, EAGAIN);
    }
    ~FullDoor() {
        for (const int one : waiting_) ::close(one);
        ::close(listener_);
    }
    FullDoor(const FullDoor&) = delete;
    FullDoor& operator=(const FullDoor&) = delete;

    /// Lets those in who waited, and answers who comes after them.
    void serve_next(std::string_view length = "2") const {
        const std::string answer =
            "HTTP/1.1 200 OK\r\nContent-Length: " + std::string(length) + "\r\n\r\n{}";
        std::vector<int> inside;
        for (std::size_t n = 0; n < waiting_.size(); ++n)
            inside.push_back(::accept(listener_, nullptr, nullptr));
        char request = 0;
        EXPECT_EQ(::recv(inside.back(), &request, 1, 0), 1);
        EXPECT_EQ(::send(inside.back(), answer.data(), answer.size(), MSG_NOSIGNAL),
                  static_cast<ssize_t>(answer.size()));
        for (const int one : inside) ::close(one);
    }

  private:
    [[nodiscard]] const sockaddr* generic() const {
        return reinterpret_cast<const sockaddr*>(&address_);
    }
    sockaddr_un address_{AF_UNIX, {}};
    int listener_ = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    std::vector<int> waiting_;  ///< the last one found no place
};

// Whoever types "vibrig abort" into a crowd has to be heard when their turn comes.
TEST(Client, WaitsForItsTurnWhereTheQueueOfTheDoorIsFull) {
    const TemporaryFolder folder;
    const FullDoor door(folder.file("s"));
    std::jthread later([&] {
        std::this_thread::sleep_for(100ms);
        door.serve_next();
    });
    EXPECT_EQ(Client(folder.file("s"), 20s).post("/", "{}").status, 200);
}

TEST(Client, GivesUpInItsTimeWhereNobodyTakesIt) {
    const TemporaryFolder folder;
    const FullDoor door(folder.file("s"));
    const auto begun = std::chrono::steady_clock::now();
    try {
        (void)Client(folder.file("s"), 200ms).get("/");
        ADD_FAILURE() << "it was answered";
    } catch (const NotRunning& error) {
        ADD_FAILURE() << error.what();
    } catch (const ClientError& error) {
        EXPECT_NE(std::string_view(error.what()).find("its queue is full"), std::string_view::npos)
            << error.what();
    }
    EXPECT_GE(std::chrono::steady_clock::now() - begun, 200ms);
}

TEST(Client, AnAnswerThatAnnouncesMoreThanThereIsMemoryIsNone) {
    const TemporaryFolder folder;
    const FullDoor door(folder.file("s"));
    std::jthread later([&] { door.serve_next("99999999999"); });
    try {
        (void)Client(folder.file("s"), 20s).get("/");
        ADD_FAILURE() << "it was taken";
    } catch (const ClientError& error) {
        EXPECT_EQ(std::string(error.what()).rfind("vibrigd at " + folder.file("s"), 0), 0u)
            << error.what();
    }
}

TEST(Client, SaysWhoDoesNotAnswer) {
    const TemporaryFolder folder;
    const std::string path = folder.file("nobody.sock");
    try {
        (void)Client(path).get("/healthz");
        FAIL() << "nobody is there";
    } catch (const NotRunning& error) {
        EXPECT_EQ(std::string(error.what())
                      .rfind("no vibrigd answers at " + path + " (is it running?", 0),
                  0u)
            << error.what();
    }
    EXPECT_THROW((void)Client(std::string(300, 'x')).get("/healthz"), ClientError);
    EXPECT_THROW((void)Client("").get("/healthz"), ClientError);
}

}  // namespace
}  // namespace vibrig::serve
