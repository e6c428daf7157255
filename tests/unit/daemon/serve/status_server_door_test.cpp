#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <thread>

#include "daemon/serve/status_server.hpp"
#include "tests/unit/daemon/serve/fake_source.hpp"
#include "tests/unit/daemon/serve/raw_connection.hpp"
#include "tests/unit/support/temporary_folder.hpp"

// Doors that somebody takes away, and a stop that somebody else's command must not hold up.
namespace vibrig::serve {
namespace {

using namespace std::chrono_literals;

bool soon(const std::function<bool()>& condition) {
    for (int i = 0; i < 1000; ++i) {
        if (condition()) return true;
        std::this_thread::sleep_for(10ms);
    }
    return false;
}

class Door : public testing::Test {
  protected:
    Door() {
        settings.socket = folder.file("control");
        settings.status_socket = folder.file("status");
        server = std::make_unique<StatusServer>(source, settings);
        server->answer();
    }
    [[nodiscard]] bool answers(const std::string& path) const {
        return soon([&] {
            try {
                return std::filesystem::is_socket(path) && status_of(get(path, "/healthz")) == 200;
            } catch (const std::runtime_error&) {
                return false;  // it is there before anybody listens to it
            }
        });
    }
    [[nodiscard]] std::size_t times_logged(const std::string& words) const {
        const std::string all = source.logged();
        std::size_t n = 0;
        for (std::size_t at = all.find(words); at != std::string::npos;
             at = all.find(words, at + 1))
            ++n;
        return n;
    }

    FakeSource source;
    TemporaryFolder folder;
    ServerSettings settings;
    std::unique_ptr<StatusServer> server;
};

TEST_F(Door, IsMadeAnewWhenItsSocketIsRemoved) {
    const RawConnection before(settings.socket);
    for (const std::string& path : {settings.socket, settings.status_socket}) {
        std::filesystem::remove(path);
        EXPECT_TRUE(answers(path)) << path;
    }
    EXPECT_EQ(times_logged("alarm: control socket " + settings.socket + " was removed: made anew"),
              1u)
        << source.logged();
    EXPECT_EQ(times_logged("alarm: status socket"), 1u) << source.logged();
    // Who was inside stays inside.
    before.send("GET /healthz HTTP/1.1\r\nHost: x\r\n\r\n");
    EXPECT_EQ(status_of(before.answer()), 200);
    EXPECT_TRUE(soon([&] {
        const auto doors = source.server().doors;
        return doors.size() == 2 && doors[0].made_anew == 1 && doors[0].open;
    }));
    // and it is this daemon's again: it goes with it
    server.reset();
    EXPECT_FALSE(std::filesystem::exists(settings.socket));
}

TEST_F(Door, IsMadeAnewWhereSomethingElseLies) {
    std::filesystem::remove(settings.socket);
    std::ofstream(settings.socket) << "a letter";
    EXPECT_TRUE(answers(settings.socket));
    std::string kept;
    std::getline(std::ifstream(settings.socket + ".found"), kept);
    EXPECT_EQ(kept, "a letter");
    std::filesystem::rename(settings.socket, folder.file("away"));
    std::filesystem::create_symlink("nowhere", settings.socket);
    EXPECT_TRUE(answers(settings.socket));
}

TEST_F(Door, LeavesTheLivingAloneAndComesBackAfterThem) {
    {
        const SocketFile other(folder.file("other"));
        // Over it: between a removal and another's bind the door would be made anew.
        std::filesystem::rename(folder.file("other"), settings.socket);
        EXPECT_TRUE(soon([&] { return times_logged("another vibrigd answers") == 1; }));
        std::this_thread::sleep_for(1200ms);
        EXPECT_EQ(times_logged("another vibrigd answers"), 1u) << "it is logged once";
        const auto doors = source.server().doors;
        EXPECT_FALSE(doors[0].open);
        EXPECT_NE(doors[0].note.find("another vibrigd"), std::string::npos);
    }
    EXPECT_TRUE(answers(settings.socket));
}

TEST_F(Door, StaysAsItIsWhileNothingIsWrong) {
    std::this_thread::sleep_for(2500ms);
    EXPECT_EQ(source.logged(), "");
    EXPECT_EQ(source.server().doors[0].made_anew, 0u);
}

TEST_F(Door, HearsAStopWhileAnotherCommandTakesItsTime) {
    // GIVEN an arming that waits for a slow disk, and more commands behind it
    source.slow = true;
    const auto send = [&](const RawConnection& to, const char* kind) {
        const std::string body = R"({"kind":")" + std::string(kind) + R"(","by":"Ada"})";
        to.send("POST /api/v1/commands HTTP/1.1\r\nHost: x\r\nContent-Length: " +
                std::to_string(body.size()) + "\r\n\r\n" + body);
    };
    const RawConnection arming(settings.socket), starting(settings.socket);
    send(arming, "arm");
    EXPECT_TRUE(soon([&] { return source.asked_to_arm > 0; }));
    send(starting, "start");
    // WHEN a stop comes THEN it is carried out and answered, others are answered as well
    EXPECT_EQ(status_of(get(settings.socket, "/api/v1/status")), 200);
    EXPECT_EQ(
        status_of(post(settings.socket, "/api/v1/commands", R"({"kind":"abort","by":"Eve"})")),
        200);
    EXPECT_EQ(source.requests().size(), 1u) << "the stop alone";
    // and what had not begun does not follow it
    const std::string refused = starting.answer();
    EXPECT_EQ(status_of(refused), 409);
    EXPECT_NE(refused.find("a stop came before it"), std::string::npos) << refused;
    source.slow = false;
    EXPECT_EQ(status_of(arming.answer()), 200);
    EXPECT_EQ(source.requests().size(), 2u);
}

}  // namespace
}  // namespace vibrig::serve
