#include "daemon/serve/status_server.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "daemon/serve/client.hpp"
#include "daemon/serve/openapi.hpp"
#include "daemon/serve/status_json.hpp"
#include "tests/unit/daemon/serve/fake_source.hpp"
#include "tests/unit/daemon/serve/raw_connection.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::serve {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

class Server : public testing::Test {
  protected:
    FakeSource source;
    TemporaryFolder folder;
    std::string path = folder.file("vibrigd.sock");
    std::unique_ptr<StatusServer> server = std::make_unique<StatusServer>(source, path);
};

TEST_F(Server, AnswersEveryPath) {
    Client client(path);
    EXPECT_EQ(client.get("/api/v1/status").body, status_json(source.status()));
    EXPECT_EQ(client.get("/api/v1/campaign").body, campaign_json(source.status()));
    // Weights are a map, whose order is not stated: compare up to there.
    const std::string parameters = parameters_json(source.result(), source.status().verdict);
    const std::string ordered = parameters.substr(0, parameters.find("\"weights\""));
    EXPECT_EQ(client.get("/api/v1/parameters").body.rfind(ordered, 0), 0u);
    EXPECT_EQ(client.get("/api/v1/config").body, "{\"text\":\"can.interface = vcan0\\n\"}");
    EXPECT_EQ(client.get("/healthz").body, "ok\n");
    EXPECT_EQ(client.get("/api/v1/status?").status, 200);
}

TEST_F(Server, GivesEventsAfterAnId) {
    for (int i = 1; i <= 5; ++i) {
        EventRecord event;
        event.text = "event " + std::to_string(i);
        source.log.append(event);
    }
    Client client(path);
    const std::string all = client.get("/api/v1/events").body;
    EXPECT_NE(all.find("event 1"), std::string::npos);
    EXPECT_NE(all.find("event 5"), std::string::npos);
    const std::string some = client.get("/api/v1/events?after=3&limit=1").body;
    EXPECT_EQ(some.find("event 3"), std::string::npos);
    EXPECT_NE(some.find("event 4"), std::string::npos);
    EXPECT_EQ(some.find("event 5"), std::string::npos);
    for (const char* bad : {"after=", "after=-1", "after=x", "after=1x", "before=1", "after",
                            "after=99999999999999999999", "limit=0", "limit=10001"}) {
        const Reply reply = client.get(std::string("/api/v1/events?") + bad);
        EXPECT_EQ(reply.status, 400) << bad;
        EXPECT_NE(reply.body.find("expected"), std::string::npos) << reply.body;
    }
}

TEST_F(Server, RefusesUnknownKeysOfAQuery) {
    Client client(path);
    const auto refusal = [&](const char* target) {
        const Reply reply = client.get(target);
        return std::to_string(reply.status) + ' ' + reply.body;
    };
    EXPECT_THAT(refusal("/api/v1/events?aftr=3"),
                AllOf(StartsWith("400"), HasSubstr("found 'aftr', expected after or limit")));
    EXPECT_THAT(refusal("/api/v1/history?channel=measured_g&form=3"),
                AllOf(StartsWith("400"), HasSubstr("found 'form', expected channel or from")));
    EXPECT_THAT(refusal("/api/v1/stream?rate=3"), AllOf(StartsWith("400"), HasSubstr("'rate'")));
    EXPECT_THAT(refusal("/api/v1/status?pretty"),
                AllOf(StartsWith("400"), HasSubstr("found 'pretty', expected none")));
    // A command too, but for the one that stops: it is never refused for what is beside it.
    const auto command = [&](const char* kind) {
        return client
            .post("/api/v1/commands?x=1", std::string(R"({"by":"Ada","kind":")") + kind + "\"}")
            .status;
    };
    EXPECT_EQ(command("start"), 400);
    EXPECT_TRUE(source.requests().empty());
    EXPECT_EQ(command("abort"), 200);
}

/// As clients write them that are made from the description, and requests and URLSearchParams.
TEST_F(Server, TakesEscapesInAQuery) {
    Client client(path);
    const Reply both = client.get("/api/v1/history?channel=measured_g%2Ccommand_g&from=%30");
    EXPECT_EQ(both.status, 200) << both.body;
    EXPECT_EQ(nlohmann::json::parse(both.body)["channels"].size(), 2u);
    EXPECT_EQ(client.get("/api/v1/events?%61fter=3").status, 200);
    EXPECT_THAT(client.get("/api/v1/events?a%00b=3").body, HasSubstr("found 'a?b', expected"));
    for (const char* bad : {"%", "%2", "%zz", "%+1", "%-1", "after=%", "after=1%2"}) {
        const Reply reply = client.get(std::string("/api/v1/events?") + bad);
        EXPECT_EQ(reply.status, 400) << bad;
        EXPECT_THAT(reply.body, HasSubstr("expected % and two hexadecimal digits")) << bad;
    }
}

TEST_F(Server, TakesTheKeysThatItsDescriptionHas) {
    Client client(path);
    const auto paths = nlohmann::json::parse(openapi_json())["paths"];
    for (const auto& [of, methods] : paths.items()) {
        if (!methods.contains("get")) continue;
        std::string query;
        for (const auto& one : methods["get"]["parameters"])
            query += '&' + one["name"].get<std::string>() + "=1";
        if (query.empty()) continue;
        const Reply reply = client.get(of + '?' + query.substr(1));
        EXPECT_THAT(reply.body, Not(HasSubstr("query: "))) << of;
    }
}

TEST_F(Server, RefusesUnknownPathsAndWrongMethods) {
    const std::string missing = get(path, "/api/v1/nothing");
    EXPECT_EQ(status_of(missing), 404);
    EXPECT_NE(missing.find("Content-Type: application/problem+json"), std::string::npos);
    EXPECT_NE(body_of(missing).find("\"status\":404"), std::string::npos);
    EXPECT_EQ(status_of(get(path, "/")), 404);
    EXPECT_EQ(status_of(get(path, "/api/v1/status/")), 404);
    EXPECT_EQ(status_of(get(path, "/../../etc/passwd")), 404);

    const std::string wrong = post(path, "/api/v1/status", "{}");
    EXPECT_EQ(status_of(wrong), 405);
    EXPECT_NE(wrong.find("Allow: GET"), std::string::npos);
    const std::string read = get(path, "/api/v1/commands");
    EXPECT_EQ(status_of(read), 405);
    EXPECT_NE(read.find("Allow: POST"), std::string::npos);
    EXPECT_TRUE(source.requests().empty());
}

TEST_F(Server, AnswersHeadWithoutABodyAndStaysInStep) {
    const RawConnection connection(path);
    connection.send("HEAD /api/v1/status HTTP/1.1\r\nHost: x\r\n\r\n");
    const std::string head = connection.answer();
    EXPECT_EQ(status_of(head), 405);
    EXPECT_EQ(body_of(head), "");
    connection.send("GET /healthz HTTP/1.1\r\nHost: x\r\n\r\n");
    EXPECT_EQ(body_of(connection.answer()), "ok\n");
}

TEST_F(Server, KeepsTheConnectionAndTakesRequestsInOneGo) {
    const RawConnection connection(path);
    const std::string request = "GET /healthz HTTP/1.1\r\nHost: x\r\n\r\n";
    connection.send(request + request + request);
    for (int i = 0; i < 3; ++i) EXPECT_EQ(body_of(connection.answer()), "ok\n");
    connection.send("GET /healthz HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
    const std::string last = connection.until_closed();
    EXPECT_EQ(body_of(last), "ok\n");
}

TEST_F(Server, SaysWhatASourceThatFailsSaid) {
    source.broken = true;
    const std::string answer = get(path, "/api/v1/status");
    EXPECT_EQ(status_of(answer), 500);
    EXPECT_NE(body_of(answer).find("no status today"), std::string::npos);
    source.broken = false;
    EXPECT_EQ(status_of(get(path, "/api/v1/status")), 200);
}

TEST_F(Server, OfTheNextStartIsAnotherInstance) {
    const std::string before = get(path, "/api/v1/events");
    server.reset();
    server = std::make_unique<StatusServer>(source, path);
    const std::string after = get(path, "/api/v1/events");
    EXPECT_EQ(status_of(after), 200);
    EXPECT_NE(body_of(before), body_of(after));
}

TEST_F(Server, IsFoundAgainByAClientAfterARestart) {
    Client client(path);
    EXPECT_EQ(client.get("/healthz").status, 200);
    server.reset();
    EXPECT_THROW((void)client.get("/healthz"), NotRunning);
    server = std::make_unique<StatusServer>(source, path);
    EXPECT_EQ(client.get("/healthz").status, 200);
    // Restarted between two questions: the kept connection is dead, the question is asked again
    server.reset();
    server = std::make_unique<StatusServer>(source, path);
    EXPECT_EQ(client.get("/healthz").status, 200);
}

}  // namespace
}  // namespace vibrig::serve
