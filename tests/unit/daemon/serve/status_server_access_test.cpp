#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <list>
#include <optional>
#include <thread>

#include "daemon/serve/client.hpp"
#include "daemon/serve/pki.hpp"
#include "daemon/serve/status_server.hpp"
#include "proto/vibrig.pb.h"
#include "tests/unit/daemon/serve/fake_source.hpp"
#include "tests/unit/daemon/serve/raw_connection.hpp"
#include "tests/unit/daemon/serve/slow_way.hpp"
#include "tests/unit/support/temporary_folder.hpp"

// Who may do what, through which door, and who is not let in at all.
namespace vibrig::serve {
namespace {

using std::chrono::hours;
using Use = CertificateSettings::Use;

/// All there are: one that is added is tried too.
std::vector<std::string> all_kinds() {
    std::vector<std::string> kinds;
    const auto& all = *v1::Command::Kind_descriptor();
    for (int i = 0; i < all.value_count(); ++i)
        if (all.value(i)->number() != v1::Command::unspecified)
            kinds.push_back(all.value(i)->name());
    return kinds;
}

std::string body_for(const std::string& kind) {
    return R"({"kind":")" + kind + R"(","by":"Ada","argument":"trip"})";
}

std::string without_scheme(std::string address) {
    address.erase(0, address.find("//") + 2);
    address.pop_back();
    return address;
}

class Access : public testing::Test {
  protected:
    Access() {
        save("authority", authority);
        save("server",
             make_identity({Use::server, "rig", "", {"127.0.0.1", "localhost"}}, &authority));
        settings.socket = folder.file("control");
        settings.status_socket = folder.file("status");
        settings.page = "127.0.0.1:0";
        settings.remote = "127.0.0.1:0";
        settings.certificate = folder.file("server.crt");
        settings.key = folder.file("server.key");
        settings.clients_ca = folder.file("authority.crt");
    }
    void save(const std::string& name, const Identity& identity) const {
        std::ofstream(folder.file(name + ".crt")) << identity.certificate;
        std::ofstream(folder.file(name + ".key")) << identity.key;
    }
    /// A client with this certificate; the folder's authority is the one it trusts.
    [[nodiscard]] Address remote(const std::string& name, const Identity& identity) const {
        save(name, identity);
        return {"", without_scheme(server->remote_address()), folder.file(name)};
    }
    /// Waits until a refusal with these words is audited.
    [[nodiscard]] bool logged(const std::string& words) const {
        for (int i = 0; i < 500; ++i) {
            for (const std::string& refusal : source.refusals())
                if (refusal.find(words) != std::string::npos) return true;
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
        }
        return false;
    }
    [[nodiscard]] Identity person(const std::string& role) const {
        return make_identity({Use::client, "p " + role, role, {}}, &authority);
    }

    FakeSource source;
    TemporaryFolder folder;
    Identity authority = make_identity({Use::authority, "authority", "", {}});
    ServerSettings settings;
    std::optional<StatusServer> server;
};

TEST_F(Access, EveryCommandByEveryRole) {
    server.emplace(source, settings);
    server->answer();
    struct Row {
        const char* role;
        int reads, commands;
    };
    for (const Row& row : {Row{"viewer", 200, 403}, Row{"operator", 200, 200},
                           Row{"admin", 200, 200}, Row{"chief", 403, 403}, Row{"", 403, 403}}) {
        const std::string name = std::string("p") + row.role;
        Client client(remote(name, person(row.role)));
        for (const char* path : {"/api/v1/status", "/api/v1/config", "/metrics"})
            EXPECT_EQ(client.get(path).status, row.reads) << row.role << ' ' << path;
        for (const std::string& kind : all_kinds()) {
            // Whoever lets gimbals move stands at the rig.
            const int expected = kind == "commission" ? 403 : row.commands;
            const std::size_t before = source.requests().size();
            const std::size_t refused = source.refusals().size();
            const Reply reply = client.post("/api/v1/commands", body_for(kind));
            EXPECT_EQ(reply.status, expected) << row.role << ' ' << kind << ' ' << reply.body;
            const auto requests = source.requests();
            EXPECT_EQ(requests.size() - before, expected == 200 ? 1u : 0u);
            if (expected == 200) {
                EXPECT_EQ(requests.back().by, "Ada (certificate p " + std::string(row.role) + ", " +
                                                  row.role + ", from 127.0.0.1)");
            } else {
                ASSERT_EQ(source.refusals().size() - refused, 1u) << "refusals are audited";
                const std::string words =
                    row.reads == 200 ? kind + " by Ada | certificate p " + row.role + ", " +
                                           row.role + ", from 127"
                                     : std::string("POST '/api/v1/commands' | certificate p ") +
                                           row.role + ", none, from 127";
                EXPECT_EQ(source.refusals().back().rfind(words, 0), 0u) << source.refusals().back();
            }
        }
    }
}

TEST_F(Access, EveryCommandThroughEveryLocalDoor) {
    server.emplace(source, settings);
    server->answer();
    const std::string page = without_scheme(server->page_address());
    for (const std::string& kind : all_kinds()) {
        EXPECT_EQ(status_of(post(settings.socket, "/api/v1/commands", body_for(kind))), 200)
            << kind;
        EXPECT_EQ(status_of(post(settings.status_socket, "/api/v1/commands", body_for(kind))), 403);
        const std::string body = body_for(kind);
        const RawConnection browser(page);
        browser.send("POST /api/v1/commands HTTP/1.1\r\nHost: " + page + "\r\nOrigin: http://" +
                     page + "\r\nContent-Type: application/json\r\nContent-Length: " +
                     std::to_string(body.size()) + "\r\n\r\n" + body);
        EXPECT_EQ(status_of(browser.answer()), 403) << "the page is read-only";
    }
    EXPECT_EQ(source.requests().size(), all_kinds().size());
    EXPECT_EQ(source.refusals().size(), 2 * all_kinds().size());
    EXPECT_EQ(status_of(get(settings.status_socket, "/api/v1/status")), 200);
}

TEST_F(Access, BadCertificatesAreRefused) {
    server.emplace(source, settings);
    server->answer();
    const Identity stranger = make_identity({Use::authority, "authority", "", {}});
    struct Row {
        const char* what;
        Identity identity;
        const char* logged;  ///< in the events
    };
    const std::vector<Row> bad{
        {"not yet valid", make_identity({Use::client, "a", "admin", {}, hours(24)}, &authority),
         "certificate is not yet valid"},
        {"of another authority with the same name",
         make_identity({Use::client, "a", "admin", {}}, &stranger), "issuer"},
        {"signed by itself", make_identity({Use::client, "a", "admin", {}}), "self-signed"},
        {"a server's", make_identity({Use::server, "a", "admin", {"127.0.0.1"}}, &authority),
         "unsuitable certificate purpose"},
        {"with another's key", {person("admin").certificate, person("admin").key}, nullptr}};
    for (const Row& row : bad) {
        const int before = source.asked;
        EXPECT_THROW((void)Client(remote("bad", row.identity)).get("/api/v1/status"), ClientError)
            << row.what;
        EXPECT_EQ(source.asked, before) << row.what;
        if (row.logged == nullptr) continue;  // the client refuses by itself
        EXPECT_TRUE(logged("a connection | somebody, from 127.0.0.1 | ")) << row.what;
        EXPECT_TRUE(logged(row.logged)) << row.what;
    }
    // none at all, and no TLS at all
    EXPECT_THROW((void)Client({"", without_scheme(server->remote_address()), ""}), ClientError);
    const RawConnection plain(without_scheme(server->remote_address()));
    plain.send("GET /api/v1/status HTTP/1.1\r\nHost: x\r\n\r\n");
    EXPECT_EQ(plain.until_closed().find("200 OK"), std::string::npos);
    // and a good one still is
    EXPECT_EQ(Client(remote("good", person("viewer"))).get("/healthz").status, 200);
}

TEST_F(Access, RevokedCertificatesAreRefusedAtOnce) {
    const auto list = [&](const std::string& text) {
        std::ofstream(folder.file("new")) << text;
        std::filesystem::rename(folder.file("new"), folder.file("revoked.crl"));
    };
    const Identity gone = person("admin"), ada = person("operator"), eve = person("operator");
    const std::string first = revoke(gone.certificate, authority, revoke("", authority, ""));
    list(first);
    settings.revoked = folder.file("revoked.crl");
    server.emplace(source, settings);
    server->answer();
    EXPECT_THROW((void)Client(remote("gone", gone)).get("/healthz"), ClientError);
    Client of_ada(remote("ada", ada)), of_eve(remote("eve", eve));
    EXPECT_EQ(of_ada.get("/healthz").status, 200);
    EXPECT_EQ(of_eve.get("/healthz").status, 200);
    // WHEN one more is revoked while she is connected THEN she is out, and nobody else
    list(revoke(eve.certificate, authority, first));
    bool refused = false;
    for (int i = 0; i < 300 && !refused; ++i) {
        try {
            (void)of_eve.get("/healthz");
            std::this_thread::sleep_for(std::chrono::milliseconds(20));
        } catch (const ClientError&) {
            refused = true;
        }
    }
    EXPECT_TRUE(refused);
    EXPECT_THROW((void)Client(remote("eve", eve)).post("/api/v1/commands", body_for("start")),
                 ClientError);
    EXPECT_THROW((void)Client(remote("gone", gone)).get("/healthz"), ClientError);
    EXPECT_EQ(of_ada.get("/healthz").status, 200);
    EXPECT_EQ(of_ada.post("/api/v1/commands", body_for("pause")).status, 200);
    EXPECT_EQ(source.requests().size(), 1u);
    // a list that cannot be read changes nothing and is logged
    list("no list");
    EXPECT_TRUE(logged("list of revoked certificates"));
    EXPECT_TRUE(logged("a connection | somebody, from 127.0.0.1 | certificate revoked"));
    EXPECT_THROW((void)Client(remote("eve", eve)).get("/healthz"), ClientError);
    EXPECT_EQ(Client(remote("ada", ada)).get("/healthz").status, 200);
}

TEST_F(Access, AStopGetsThroughWhileCertificatesChange) {
    const auto list = [&](const std::string& text) {
        std::ofstream(folder.file("new")) << text;
        std::filesystem::rename(folder.file("new"), folder.file("revoked.crl"));
    };
    const Identity ada = person("operator"), eve = person("operator");
    std::string revoked = revoke("", authority, "");  // nobody's
    list(revoked);
    settings.revoked = folder.file("revoked.crl");
    server.emplace(source, settings);
    server->answer();
    struct Row {
        const char* what;
        const Identity& asks;
        const Identity& goes;
        bool taken;
    };
    for (const Row& row : {Row{"another's", ada, eve, true}, Row{"her own", ada, ada, false}}) {
        // GIVEN a stop whose connection is being made
        SlowWay way(without_scheme(server->remote_address()));
        Address through = remote("asks", row.asks);
        through.host = way.address();
        int status = 0;
        std::thread stopping([&] {
            try {
                status = Client(through, std::chrono::seconds(60))
                             .post("/api/v1/commands", body_for("abort"))
                             .status;
            } catch (const ClientError& error) {
                std::cout << error.what() << '\n';
            }
        });
        way.wait_until_held();
        // WHEN meanwhile a certificate is revoked
        list(revoked = revoke(row.goes.certificate, authority, revoked));
        bool refused = false;
        for (int i = 0; i < 500 && !refused; ++i) {
            try {
                (void)Client(remote("goes", row.goes)).get("/healthz");
                std::this_thread::sleep_for(std::chrono::milliseconds(20));
            } catch (const ClientError&) {
                refused = true;
            }
        }
        EXPECT_TRUE(refused);
        way.let();
        stopping.join();
        // THEN it is taken, unless its own is
        EXPECT_EQ(status, row.taken ? 200 : 0) << row.what;
    }
}

TEST_F(Access, OfAnExpiredCertificateAnAbortIsTakenAndNothingElse) {
    const auto expired = [&](const char* name, const char* role) {
        return make_identity({Use::client, name, role, {}, hours(-48), hours(24)}, &authority);
    };
    const Identity gone = expired("gone", "operator");
    std::ofstream(folder.file("revoked.crl")) << revoke(gone.certificate, authority, "");
    settings.revoked = folder.file("revoked.crl");
    server.emplace(source, settings);
    server->answer();
    const Address ada = remote("ada", expired("ada", "operator"));
    for (const std::string& kind : all_kinds()) {
        const Reply reply = Client(ada).post("/api/v1/commands", body_for(kind));
        EXPECT_EQ(reply.status, kind == "abort" ? 200 : 403) << kind << ' ' << reply.body;
        if (kind != "abort") {
            EXPECT_NE(reply.body.find("has expired"), std::string::npos);
        }
    }
    for (const char* path : {"/api/v1/status", "/metrics", "/healthz", "/"})
        EXPECT_EQ(Client(ada).get(path).status, 403) << path;
    EXPECT_THROW(Client(ada).follow("/api/v1/stream", [](const std::string&) { return false; }),
                 ClientError);
    // Its audit says whose it was, and since when it is over.
    ASSERT_EQ(source.requests().size(), 1u);
    const std::string by = source.requests().front().by;
    EXPECT_EQ(by.rfind("Ada (certificate ada, operator, expired 20", 0), 0u) << by;
    EXPECT_NE(source.logged().find("an abort is taken from an expired certificate"),
              std::string::npos);
    // One who never could, cannot now; a revoked one is nobody.
    EXPECT_EQ(Client(remote("wall", expired("wall", "viewer")))
                  .post("/api/v1/commands", body_for("abort"))
                  .status,
              403);
    EXPECT_THROW((void)Client(remote("gone", gone)).post("/api/v1/commands", body_for("abort")),
                 ClientError);
    EXPECT_EQ(source.requests().size(), 1u);
}

TEST_F(Access, AnAbortGetsThroughWhenTheAuthorityAndTheServerHaveExpired) {
    authority = make_identity({Use::authority, "authority", "", {}, hours(-48), hours(24)});
    save("authority", authority);
    save("server",
         make_identity({Use::server, "rig", "", {"127.0.0.1"}, hours(-48), hours(24)}, &authority));
    server.emplace(source, settings);
    server->answer();
    Address ada = remote("ada", person("operator"));
    EXPECT_THROW((void)Client(ada).get("/healthz"), ClientError);
    ada.expired_too = true;
    EXPECT_EQ(Client(ada).post("/api/v1/commands", body_for("abort")).status, 200);
    EXPECT_EQ(Client(ada).post("/api/v1/commands", body_for("arm")).status, 403);
    EXPECT_EQ(source.requests().size(), 1u);
    // and it is logged
    for (int i = 0; i < 500 && source.logged().find("authority") == std::string::npos; ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    EXPECT_NE(source.logged().find("certificate of the server has expired"), std::string::npos);
    EXPECT_NE(source.logged().find("certificate of the authority has expired"), std::string::npos);
}

TEST_F(Access, AConnectionLivesNoLongerThanItsCertificate) {
    server.emplace(source, settings);
    server->answer();
    const auto ends_soon = [&](const char* name) {
        return make_identity(
            {Use::client, name, "operator", {}, hours(-1), hours(1) + std::chrono::seconds(12)},
            &authority);
    };
    // GIVEN one who streams and one who asks, with certificates that end in 12 s
    const Address eve = remote("eve", ends_soon("eve"));
    Client of_ada(remote("ada", ends_soon("ada")));
    EXPECT_EQ(of_ada.get("/healthz").status, 200);
    std::thread streaming([&] {
        EXPECT_THROW(
            Client(eve).follow("/api/v1/stream?rate_hz=1", [](const std::string&) { return true; }),
            ClientError)
            << "the stream ends by itself";
    });
    // While they are there, the status says when they have to go.
    const auto listed = [&](const char* who) {
        for (const auto& certificate : source.server().certificates)
            if (certificate.whose.find(who) != std::string::npos) return true;
        return false;
    };
    for (int i = 0; i < 1500 && !(listed("ada") && listed("eve")); ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    EXPECT_TRUE(listed("ada") && listed("eve"));
    streaming.join();
    // THEN what is asked on the old connection is asked with an expired certificate. Ada's was
    // made after Eve's and ends as much later.
    for (int i = 0; i < 600 && of_ada.get("/healthz").status != 403; ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
    EXPECT_EQ(of_ada.get("/healthz").status, 403);
    EXPECT_EQ(of_ada.post("/api/v1/commands", body_for("arm")).status, 403);
    EXPECT_EQ(of_ada.post("/api/v1/commands", body_for("abort")).status, 200);
}

TEST_F(Access, OnlyTheAuthoritysOwnCertificatesAreRevokedAndOnce) {
    const Identity stranger = make_identity({Use::authority, "authority", "", {}});
    const Identity ada = person("operator");
    EXPECT_THROW((void)revoke(ada.certificate, stranger, ""), PkiError);
    const std::string list = revoke(ada.certificate, authority, "");
    EXPECT_THROW((void)revoke(ada.certificate, authority, list), PkiError);
    EXPECT_THROW((void)revoke("no certificate", authority, list), PkiError);
    EXPECT_THROW((void)revoke(person("viewer").certificate, authority, "no list"), PkiError);
}

TEST_F(Access, BadServersAreNotBelieved) {
    struct Row {
        const char* what;
        CertificateSettings settings;
    };
    for (const Row& row :
         {Row{"of another host", {Use::server, "rig", "", {"rig.elsewhere"}}},
          Row{"expired", {Use::server, "rig", "", {"127.0.0.1"}, hours(-48), hours(24)}},
          Row{"a person's", {Use::client, "rig", "", {"127.0.0.1"}}}}) {
        save("server", make_identity(row.settings, &authority));
        server.emplace(source, settings);
        server->answer();
        EXPECT_THROW((void)Client(remote("ada", person("admin"))).get("/healthz"), ClientError)
            << row.what;
        server.reset();
    }
}

TEST_F(Access, StrangersPagesAreNotAnswered) {
    server.emplace(source, settings);
    server->answer();
    const std::string page = without_scheme(server->page_address());
    const std::string port = page.substr(page.find(':'));
    const auto ask = [&](const std::string& path, const std::string& host,
                         const std::string& more = "") {
        const RawConnection browser(page);
        browser.send("GET " + path + " HTTP/1.1\r\nHost: " + host + "\r\n" + more + "\r\n");
        return browser.answer();
    };
    const std::string front = ask("/", page);
    EXPECT_EQ(status_of(front), 200);
    EXPECT_NE(front.find("Content-Security-Policy: default-src 'none'"), std::string::npos);
    EXPECT_EQ(status_of(ask("/", "localhost" + port)), 200);
    EXPECT_EQ(status_of(ask("/", "evil.example" + port)), 421) << "a name bound anew";
    EXPECT_EQ(status_of(ask("/api/v1/status", "127.0.0.1")), 421);
    EXPECT_EQ(status_of(ask("/api/v1/status", "")), 421);
    EXPECT_EQ(status_of(ask("/api/v1/status", page, "Origin: http://" + page + "\r\n")), 200);
    EXPECT_EQ(status_of(ask("/api/v1/status", page, "Origin: http://evil.example\r\n")), 403);
    EXPECT_EQ(status_of(ask("/api/v1/status", page, "Origin: null\r\n")), 403);
    const std::string upgrade =
        "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";
    EXPECT_EQ(status_of(ask("/api/v1/stream", page, upgrade + "Origin: http://" + page + "\r\n")),
              101);
    EXPECT_EQ(status_of(ask("/api/v1/stream", page, upgrade + "Origin: http://evil.example\r\n")),
              403);
    EXPECT_EQ(status_of(ask("/api/v1/streams", page, upgrade)), 404);
    const std::string host = "Host: " + page + "\r\n", origin = "Origin: http://" + page + "\r\n";
    EXPECT_EQ(status_of(ask("/", page, host)), 400);
    EXPECT_EQ(status_of(ask("/", page, "Host: evil.example\r\n")), 400);
    EXPECT_EQ(status_of(ask("/", page, origin + "Origin: http://evil.example\r\n")), 400);
    EXPECT_EQ(status_of(ask("/api/v1/stream", page, upgrade + origin + origin)), 400);
    // and who tried it is logged
    EXPECT_TRUE(logged("GET '/api/v1/stream' | page, from 127.0.0.1 | Origin: found it twice"));
    EXPECT_TRUE(logged("GET '/' | page, from 127.0.0.1 | Host: found 'evil.example" + port));
    EXPECT_TRUE(logged("GET '/api/v1/status' | page, from 127.0.0.1 | Origin: found 'null'"));
    EXPECT_TRUE(logged("GET '/api/v1/stream' | page, from 127.0.0.1 | Origin: found 'http://evil"));
    for (const char* wrong : {"rate_hz=x", "rate_hz=21", "after=-1", "after=x", "status=maybe"})
        EXPECT_EQ(status_of(ask(std::string("/api/v1/stream?") + wrong, page, upgrade)), 400)
            << wrong;
}

TEST_F(Access, WhoHoldsConnectionsOpenDoesNotLockOutTheStop) {
    server.emplace(source, settings);
    server->answer();
    // GIVEN more idle connections than there are places, to the page and, without a certificate, to
    // the remote door
    const std::string page = without_scheme(server->page_address());
    std::list<RawConnection> idle;
    for (int i = 0; i < 200; ++i) {
        idle.emplace_back(without_scheme(server->remote_address()));
        if (i < 100) idle.emplace_back(page);
    }
    // WHEN an operator wants to stop the rig THEN he is heard, each time
    const Identity ada = person("operator");
    for (int i = 0; i < 3; ++i)
        EXPECT_EQ(Client(remote("ada", ada)).post("/api/v1/commands", body_for("abort")).status,
                  200);
    EXPECT_EQ(status_of(post(settings.socket, "/api/v1/commands", body_for("abort"))), 200);
    EXPECT_EQ(status_of(get(settings.status_socket, "/api/v1/status")), 200);
    EXPECT_EQ(source.requests().size(), 4u);
    // and the full door alone is logged, once
    EXPECT_NE(RawConnection(page).until_closed().find("all 64 connections of the page are taken"),
              std::string::npos);
    EXPECT_TRUE(logged("64 wait to show a certificate"));
    const auto refusals = source.refusals();
    EXPECT_EQ(std::count_if(refusals.begin(), refusals.end(),
                            [](const std::string& text) {
                                return text.find("connections of") != std::string::npos;
                            }),
              1);
    EXPECT_EQ(refusals.size(), 2u);
}

TEST_F(Access, WhoFindsNoPlaceLearnsSoOverTlsToo) {
    settings.limits.connections = 2;
    server.emplace(source, settings);
    server->answer();
    const Identity ada = person("operator");
    {
        Client first(remote("ada", ada)), second(remote("ada", ada));
        EXPECT_EQ(first.get("/healthz").status, 200);
        EXPECT_EQ(second.get("/healthz").status, 200);
        const Reply reply = Client(remote("ada", ada)).get("/healthz");
        EXPECT_EQ(reply.status, 503);
        EXPECT_NE(reply.body.find("all 2 connections of server.remote"), std::string::npos);
    }
    int status = 0;
    for (int i = 0; i < 1000 && status != 200; ++i)
        status = Client(remote("ada", ada)).get("/healthz").status;
    EXPECT_EQ(status, 200) << "their places are free again";
}

TEST_F(Access, ManyCommandsAreTooManyButAStopNeverIs) {
    server.emplace(source, settings);
    server->answer();
    Client client(settings.socket);
    int taken = 0, refused = 0;
    for (int i = 0; i < 200; ++i) {
        const int status = client.post("/api/v1/commands", body_for("pause")).status;
        taken += status == 200 ? 1 : 0;
        refused += status == 429 ? 1 : 0;
        ASSERT_EQ(client.post("/api/v1/commands", body_for("abort")).status, 200) << i;
    }
    EXPECT_EQ(taken + refused, 200);
    EXPECT_GT(refused, 0);
    EXPECT_GE(taken, 25) << "a burst is fine";
}

TEST_F(Access, NobodyUsesUpAnothersCommands) {
    server.emplace(source, settings);
    server->answer();
    // GIVEN a flood from the page, which may not command, and one from an operator
    const std::string page = without_scheme(server->page_address());
    const std::string body = body_for("arm");
    const RawConnection browser(page);
    for (int i = 0; i < 200; ++i) {
        browser.send("POST /api/v1/commands HTTP/1.1\r\nHost: " + page +
                     "\r\nContent-Type: application/json\r\nContent-Length: " +
                     std::to_string(body.size()) + "\r\n\r\n" + body);
        ASSERT_EQ(status_of(browser.answer()), 403) << i;
    }
    // THEN it is logged, but does not drown the events
    EXPECT_GE(source.refusals().size(), 10u);
    EXPECT_LE(source.refusals().size(), 50u);
    Client local(settings.socket);
    int status = 0;
    for (int i = 0; i < 2000 && status != 429; ++i)
        status = local.post("/api/v1/commands", body_for("pause")).status;
    EXPECT_EQ(status, 429);
    EXPECT_TRUE(logged("pause by Ada | uid " + std::to_string(::getuid()) + " | more than 10"));
    // WHEN another operator commands THEN nothing of that is hers
    EXPECT_EQ(Client(remote("ada", person("operator"))).post("/api/v1/commands", body).status, 200);
}

TEST_F(Access, SettingsThatCannotBeAreRefusedByName) {
    struct Row {
        std::string ServerSettings::*field;
        const char *value, *words;
    };
    for (const Row& row :
         {Row{&ServerSettings::page, "0.0.0.0:0", "loopback"},
          Row{&ServerSettings::page, "127.0.0.1", "expected HOST:PORT"},
          Row{&ServerSettings::remote, "no.such.host.invalid:1", "server.remote"},
          Row{&ServerSettings::certificate, "/nowhere.crt", "/nowhere.crt"},
          Row{&ServerSettings::clients_ca, "/nowhere.crt", "authority"},
          Row{&ServerSettings::revoked, "/nowhere.crl", "list of revoked certificates"},
          Row{&ServerSettings::operator_group, "no-such-group", "server.operator_group"}}) {
        ServerSettings bad = settings;
        bad.*row.field = row.value;
        try {
            const StatusServer refused(source, bad);
            ADD_FAILURE() << row.value;
        } catch (const ServeError& error) {
            EXPECT_NE(std::string(error.what()).find(row.words), std::string::npos) << error.what();
        }
    }
}

}  // namespace
}  // namespace vibrig::serve
