#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <fstream>
#include <functional>
#include <thread>

#include "daemon/serve/client.hpp"
#include "daemon/serve/pki.hpp"
#include "daemon/serve/status_server.hpp"
#include "tests/unit/daemon/serve/fake_source.hpp"
#include "tests/unit/daemon/serve/raw_connection.hpp"
#include "tests/unit/support/temporary_folder.hpp"

// Doors in TCP whose listening socket is taken away, as `ss --kill` does.
namespace vibrig::serve {
namespace {

using namespace std::chrono_literals;

bool before_long(const std::function<bool()>& condition) {
    for (int i = 0; i < 1000; ++i) {
        if (condition()) return true;
        std::this_thread::sleep_for(10ms);
    }
    return false;
}

sockaddr_in loopback(std::uint16_t port) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return address;
}

/// No longer listens; its owner is not notified.
void shut(std::uint16_t port) {
    for (int fd = 3; fd < 1024; ++fd) {
        int listens = 0;
        socklen_t size = sizeof listens;
        sockaddr_in address{};
        socklen_t length = sizeof address;
        if (::getsockopt(fd, SOL_SOCKET, SO_ACCEPTCONN, &listens, &size) == 0 && listens != 0 &&
            ::getsockname(fd, reinterpret_cast<sockaddr*>(&address), &length) == 0 &&
            address.sin_family == AF_INET && ntohs(address.sin_port) == port) {
            ::shutdown(fd, SHUT_RDWR);
            return;
        }
    }
    FAIL() << "nobody listens at " << port;
}

class TcpDoor : public testing::Test {
  protected:
    using Use = CertificateSettings::Use;

    TcpDoor() {
        save("authority", authority);
        save("server", make_identity({Use::server, "rig", "", {"127.0.0.1"}}, &authority));
        save("viewer", make_identity({Use::client, "Eve", "viewer", {}}, &authority));
        settings.socket = folder.file("control");
        settings.page = settings.remote = "127.0.0.1:0";
        settings.certificate = folder.file("server.crt");
        settings.key = folder.file("server.key");
        settings.clients_ca = folder.file("authority.crt");
        server = std::make_unique<StatusServer>(source, settings);
        server->answer();
        page = host_of(server->page_address());
        remote = host_of(server->remote_address());
    }
    void save(const std::string& name, const Identity& identity) const {
        std::ofstream(folder.file(name + ".crt")) << identity.certificate;
        std::ofstream(folder.file(name + ".key")) << identity.key;
    }
    static std::string host_of(std::string address) {
        address.erase(0, address.find("//") + 2);
        address.pop_back();
        return address;
    }
    static std::uint16_t port_of(const std::string& host) {
        return static_cast<std::uint16_t>(std::stoi(host.substr(host.rfind(':') + 1)));
    }
    [[nodiscard]] bool logged(const std::string& words) const {
        return before_long([&] { return source.logged().find(words) != std::string::npos; });
    }
    [[nodiscard]] ServerStatus::Door door(const std::string& name) const {
        for (const auto& one : source.server().doors)
            if (one.name == name) return one;
        return {};
    }
    [[nodiscard]] std::string request() const {
        return "GET /healthz HTTP/1.1\r\nHost: " + page + "\r\n\r\n";
    }

    Identity authority = make_identity({Use::authority, "lab", "", {}}, nullptr);
    FakeSource source;
    TemporaryFolder folder;
    ServerSettings settings;
    std::unique_ptr<StatusServer> server;
    std::string page, remote;
};

TEST_F(TcpDoor, IsMadeAnewWhenItNoLongerListens) {
    const RawConnection before(page);
    before.send(request());
    ASSERT_EQ(status_of(before.answer()), 200) << "or it might go with the queue";
    shut(port_of(page));
    EXPECT_TRUE(logged("alarm: page door http://" + page + "/ takes no connection"));
    EXPECT_TRUE(logged("made anew"));
    EXPECT_TRUE(logged("page door http://" + page + "/ takes connections again"));
    const RawConnection after(page);
    after.send(request());
    EXPECT_EQ(status_of(after.answer()), 200);
    // Who was inside stays inside.
    before.send(request());
    EXPECT_EQ(status_of(before.answer()), 200);
    EXPECT_TRUE(before_long([&] { return door("page").open && door("page").made_anew == 1; }));
    // AND so is the one with certificates
    shut(port_of(remote));
    EXPECT_TRUE(logged("remote door https://" + remote + "/ takes connections again"));
    Client client({"", remote, folder.file("viewer")});
    EXPECT_EQ(client.get("/healthz").status, 200);
    EXPECT_TRUE(source.refusals().empty()) << "its own connections are nobody's handshake";
}

TEST_F(TcpDoor, SaysOnceWhoStandsInItAndComesBackAfterThem) {
    const std::uint16_t port = port_of(page);
    shut(port);
    const int other = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const int on = 1;
    ::setsockopt(other, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    const sockaddr_in address = loopback(port);
    ASSERT_EQ(::bind(other, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    ASSERT_EQ(::listen(other, 64), 0);
    EXPECT_TRUE(logged("leads elsewhere"));
    EXPECT_TRUE(logged("and cannot be made anew"));
    EXPECT_TRUE(before_long([&] { return !door("page").open && !door("page").note.empty(); }));
    const std::string then = source.logged();
    std::this_thread::sleep_for(2500ms);
    EXPECT_EQ(source.logged(), then) << "it is logged once";
    ::close(other);
    EXPECT_TRUE(logged("takes connections again"));
}

/// At boot, before the network: a daemon that gave up then would measure nothing for the night.
TEST_F(TcpDoor, WaitsForAnAddressThatTheMachineDoesNotHaveYet) {
    server.reset();
    settings.remote = "192.0.2.1:0";  // of nobody: RFC 5737
    server = std::make_unique<StatusServer>(source, settings);
    server->answer();
    EXPECT_TRUE(before_long([&] { return !door("remote").open; }));
    EXPECT_TRUE(logged("alarm: remote door https://192.0.2.1:"));
    EXPECT_TRUE(door("page").open);
    // The page is for this machine alone: its address is there.
    settings.page = "127.0.0.1:nothing";
    EXPECT_THROW(StatusServer(source, settings), ServeError);
}

TEST_F(TcpDoor, StaysAsItIsWhileNothingIsWrong) {
    std::this_thread::sleep_for(3500ms);
    EXPECT_EQ(source.logged(), "");
    EXPECT_TRUE(source.refusals().empty());
    EXPECT_EQ(door("page").made_anew + door("remote").made_anew, 0u);
}

}  // namespace
}  // namespace vibrig::serve
