#include <gtest/gtest.h>

#include <list>
#include <random>

#include "daemon/serve/status_server.hpp"
#include "tests/unit/daemon/serve/fake_source.hpp"
#include "tests/unit/daemon/serve/raw_connection.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::serve {
namespace {

using namespace std::chrono_literals;

const std::string kHealth = "GET /healthz HTTP/1.1\r\nHost: x\r\n\r\n";

class ServerLimitsTest : public testing::Test {
  protected:
    FakeSource source;
    TemporaryFolder folder;
    std::string path = folder.file("s");
};

TEST_F(ServerLimitsTest, RefuseALongHeader) {
    const StatusServer server(source, path);
    const RawConnection connection(path);
    connection.send("GET /healthz HTTP/1.1\r\nHost: x\r\nX: " + std::string(9'000, 'a') +
                    "\r\n\r\n");
    const std::string answer = connection.until_closed();
    EXPECT_EQ(status_of(answer), 431) << answer;
    // without an end, too
    const RawConnection endless(path);
    endless.send("GET /" + std::string(100'000, 'a'));
    EXPECT_EQ(status_of(endless.until_closed()), 431);
    // and what fits is taken
    const RawConnection fits(path);
    fits.send("GET /healthz HTTP/1.1\r\nHost: x\r\nX: " + std::string(7'900, 'a') + "\r\n\r\n");
    EXPECT_EQ(status_of(fits.answer()), 200);
}

TEST_F(ServerLimitsTest, RefuseALongBody) {
    const StatusServer server(source, path);
    // announced
    const std::string answer = post(path, "/api/v1/commands", std::string(17'000, ' '));
    EXPECT_EQ(status_of(answer), 413) << answer;
    // absurdly announced
    const RawConnection absurd(path);
    absurd.send(
        "POST /api/v1/commands HTTP/1.1\r\nHost: x\r\n"
        "Content-Length: 18446744073709551615\r\n\r\n");
    const int status = status_of(absurd.until_closed());
    EXPECT_TRUE(status == 413 || status == 400) << status;
    // in chunks, without an announcement
    const RawConnection chunked(path);
    chunked.send(
        "POST /api/v1/commands HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n"
        "5000\r\n" +
        std::string(0x5000, ' ') + "\r\n0\r\n\r\n");
    EXPECT_EQ(status_of(chunked.until_closed()), 413);
    // what fits is read to its end
    const std::string body = R"({"kind":"abort","by":"Ada"})";
    EXPECT_EQ(status_of(post(path, "/api/v1/commands", std::string(16'000, ' ') + body)), 200);
    EXPECT_EQ(source.requests().size(), 1u);
}

TEST_F(ServerLimitsTest, AnswerGarbageOnceAndClose) {
    const StatusServer server(source, path);
    const RawConnection connection(path);
    connection.send("this is not HTTP\r\n\r\n");
    const std::string answer = connection.until_closed();
    EXPECT_EQ(status_of(answer), 400) << answer;
    EXPECT_NE(answer.find("application/problem+json"), std::string::npos);

    constexpr unsigned kSeed = 20090401;
    std::mt19937 random(kSeed);
    for (int round = 0; round < 50; ++round) {
        std::string bytes(1 + random() % 2000, '\0');
        for (char& c : bytes) c = static_cast<char>(random());
        const RawConnection noise(path);
        noise.send(bytes);
        noise.finish_sending();
        const std::string said = noise.until_closed();
        EXPECT_TRUE(said.empty() || status_of(said) == 400) << "seed " << kSeed << ": " << said;
    }
    EXPECT_EQ(status_of(get(path, "/healthz")), 200);
}

TEST_F(ServerLimitsTest, EndAHalfRequestQuietly) {
    const StatusServer server(source, path);
    for (std::size_t length = 0; length < kHealth.size(); length += 5) {
        const RawConnection connection(path);
        connection.send(kHealth.substr(0, length));
        connection.finish_sending();
        EXPECT_EQ(connection.until_closed(), "") << length;
    }
    EXPECT_EQ(status_of(get(path, "/healthz")), 200);
}

TEST_F(ServerLimitsTest, LetASlowClientHoldNobodyUp) {
    const StatusServer server(source, path);
    // GIVEN clients that have sent half a request, and one that takes no answers
    std::list<RawConnection> slow;
    for (int i = 0; i < 20; ++i) slow.emplace_back(path).send("GET /hea");
    const RawConnection deaf(path);
    for (int i = 0; i < 100; ++i) deaf.send("GET /api/v1/status HTTP/1.1\r\nHost: x\r\n\r\n");
    // WHEN others ask, THEN they are answered
    for (int i = 0; i < 20; ++i) EXPECT_EQ(status_of(get(path, "/healthz")), 200);
    // and the slow ones when they are done
    for (RawConnection& connection : slow) {
        connection.send("lthz HTTP/1.1\r\nHost: x\r\n\r\n");
        EXPECT_EQ(body_of(connection.answer()), "ok\n");
    }
}

TEST_F(ServerLimitsTest, CloseWhoSaysNothing) {
    const StatusServer server(source, path, {.idle_timeout = 100ms});
    const RawConnection silent(path);
    EXPECT_EQ(silent.until_closed(), "");
    const RawConnection dripping(path);
    dripping.send("GET /");
    EXPECT_EQ(dripping.until_closed(), "");
    // One who says something has to come to it before that: more time, on a busy machine.
    const std::string patient = folder.file("patient");
    const StatusServer later(source, patient, {.idle_timeout = 2s});
    const RawConnection kept(patient);
    kept.send(kHealth);
    const std::string said = kept.until_closed();
    EXPECT_EQ(status_of(said), 200);
    EXPECT_EQ(said.find("(open)"), std::string::npos);
}

TEST_F(ServerLimitsTest, TurnAwayOneConnectionTooMany) {
    const StatusServer server(source, path);
    // GIVEN 64 connections, all in use
    std::list<RawConnection> taken;
    for (int i = 0; i < 64; ++i) {
        taken.emplace_back(path).send(kHealth);
        ASSERT_EQ(status_of(taken.back().answer()), 200) << i;
    }
    // WHEN one more comes, THEN the answer says so
    for (int i = 0; i < 10; ++i) {
        const RawConnection extra(path);
        extra.send(kHealth);
        const std::string answer = extra.until_closed();
        EXPECT_EQ(status_of(answer), 503) << answer;
        EXPECT_NE(answer.find("64 connections"), std::string::npos);
    }
    // but with a stop, which is never one too many
    EXPECT_EQ(status_of(post(path, "/api/v1/commands", R"({"kind":"arm","by":"Ada"})")), 503);
    EXPECT_EQ(status_of(post(path, "/api/v1/commands", R"({"kind":"abort","by":"Ada"})")), 200);
    EXPECT_EQ(source.requests().size(), 1u);
    // and those who have a place keep it
    for (RawConnection& connection : taken) {
        connection.send(kHealth);
        EXPECT_EQ(status_of(connection.answer()), 200);
    }
    // WHEN they leave, THEN there is room again
    taken.clear();
    int status = 0;
    for (int i = 0; i < 1000 && status != 200; ++i) status = status_of(get(path, "/healthz"));
    EXPECT_EQ(status, 200);
}

TEST_F(ServerLimitsTest, EndWithConnectionsOpen) {
    auto server = std::make_unique<StatusServer>(source, path);
    const RawConnection idle(path);
    idle.send(kHealth);
    EXPECT_EQ(status_of(idle.answer()), 200);
    const RawConnection half(path);
    half.send("GET /");
    server.reset();
    EXPECT_EQ(idle.until_closed(), "");
    EXPECT_EQ(half.until_closed(), "");
}

}  // namespace
}  // namespace vibrig::serve
