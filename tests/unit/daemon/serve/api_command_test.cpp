#include <gtest/gtest.h>
#include <unistd.h>

#include <string>

#include "daemon/serve/client.hpp"
#include "daemon/serve/status_server.hpp"
#include "tests/unit/daemon/serve/fake_source.hpp"
#include "tests/unit/daemon/serve/raw_connection.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::serve {
namespace {

TEST(Command, ReachesTheSourceWithTheUidOfThePeer) {
    // GIVEN a server
    FakeSource source;
    const TemporaryFolder folder;
    const StatusServer server(source, folder.file("s"));
    // WHEN a command is posted
    Client client(folder.file("s"));
    const Reply reply = client.post("/api/v1/commands", R"({"kind":"arm","by":"Ada"})");
    // THEN it is dispatched with the name that was said and the uid the kernel knows
    EXPECT_EQ(reply.status, 200);
    EXPECT_EQ(reply.body, R"({"accepted":true,"message":"done"})");
    ASSERT_EQ(source.requests().size(), 1u);
    EXPECT_EQ(source.requests()[0].kind, CommandRequest::Kind::arm);
    EXPECT_EQ(source.requests()[0].by, "Ada (uid " + std::to_string(getuid()) + ")");
}

TEST(Command, RefusedByTheSourceIsAConflictWithItsReason) {
    FakeSource source;
    source.answer_commands_with({false, "not armed"});
    const TemporaryFolder folder;
    const StatusServer server(source, folder.file("s"));
    const std::string answer =
        post(folder.file("s"), "/api/v1/commands", R"({"kind":"start","by":"Ada"})");
    EXPECT_EQ(status_of(answer), 409);
    EXPECT_NE(answer.find("application/problem+json"), std::string::npos);
    EXPECT_NE(body_of(answer).find("\"detail\":\"not armed\""), std::string::npos) << answer;
}

TEST(Command, ThatIsBadNeverReachesTheSource) {
    FakeSource source;
    const TemporaryFolder folder;
    const StatusServer server(source, folder.file("s"));
    const std::string path = folder.file("s");
    EXPECT_EQ(status_of(post(path, "/api/v1/commands", "{")), 400);
    EXPECT_EQ(status_of(post(path, "/api/v1/commands", "")), 400);
    EXPECT_EQ(status_of(post(path, "/api/v1/commands", std::string("\0\xFF", 2))), 400);
    const RawConnection form(path);
    form.send(
        "POST /api/v1/commands HTTP/1.1\r\nHost: x\r\nContent-Type: text/plain\r\n"
        "Content-Length: 27\r\n\r\n{\"kind\":\"abort\",\"by\":\"Ada\"}");
    EXPECT_EQ(status_of(form.answer()), 415);
    // A request that is cut off in the middle of its body
    const RawConnection half(path);
    half.send(
        "POST /api/v1/commands HTTP/1.1\r\nHost: x\r\nContent-Length: 40\r\n\r\n"
        "{\"kind\":\"abort\",\"by\":\"Ada\"}");
    half.finish_sending();
    EXPECT_EQ(half.until_closed(), "");
    EXPECT_TRUE(source.requests().empty());
}

}  // namespace
}  // namespace vibrig::serve
