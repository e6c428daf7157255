#include "daemon/serve/status_server.hpp"

#include <grp.h>
#include <pthread.h>
#include <pwd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <boost/asio/basic_socket_acceptor.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <deque>
#include <optional>
#include <random>
#include <thread>
#include <utility>

#include "daemon/serve/session.hpp"
#include "daemon/serve/tcp_listener.hpp"
#include "daemon/serve/tls.hpp"

namespace vibrig::serve {
namespace {

namespace asio = boost::asio;
using Protocol = asio::generic::stream_protocol;
using boost::system::error_code;

constexpr auto kAcceptPause = std::chrono::milliseconds(100);
constexpr auto kCertificateLook = std::chrono::seconds(1);
constexpr auto kLife = std::chrono::milliseconds(500);

/// Changes whenever one of the files does.
std::string stamp_of(const ServerSettings& settings) {
    std::string stamp;
    for (const auto& path :
         {settings.certificate, settings.key, settings.clients_ca, settings.revoked}) {
        struct stat found {};
        if (::stat(path.c_str(), &found) != 0) found = {};
        stamp += std::to_string(found.st_ino) + ' ' + std::to_string(found.st_size) + ' ' +
                 std::to_string(found.st_mtim.tv_sec) + '.' +
                 std::to_string(found.st_mtim.tv_nsec) + '\n';
    }
    return stamp;
}

std::string random_instance() {
    std::random_device random;
    std::array<char, 17> text{};
    std::snprintf(text.data(), text.size(), "%08x%08x", random(), random());
    return text.data();
}

gid_t group_named(const std::string& name) {
    const group* const found = ::getgrnam(name.c_str());
    if (found == nullptr)
        throw ServeError("server.operator_group: found '" + name + "', expected a group's name");
    return found->gr_gid;
}

bool is_member(uid_t uid, gid_t wanted) {
    const passwd* const user = ::getpwuid(uid);
    if (user == nullptr) return false;
    constexpr int kMostGroups = 1024;
    std::vector<gid_t> groups(kMostGroups);
    int count = kMostGroups;
    if (::getgrouplist(user->pw_name, user->pw_gid, groups.data(), &count) < 0) return false;
    return std::find(groups.begin(), groups.begin() + count, wanted) != groups.begin() + count;
}

}  // namespace

struct StatusServer::Impl {
    enum class Door : std::uint8_t { control, status, page, remote };

    struct Listener {
        Listener(asio::io_context& io, Door which, const Protocol& protocol, int descriptor)
            : door(which), acceptor(io), pause(io) {
            acceptor.assign(protocol, descriptor);
        }
        Door door;
        asio::basic_socket_acceptor<Protocol> acceptor;
        asio::steady_timer pause;
    };

    Impl(StatusSource& from, const ServerSettings& given)
        : settings(given), source(from), api(from, random_instance()) {
        if (!settings.operator_group.empty()) operators = group_named(settings.operator_group);
        open_unix(Door::control, settings.socket);
        if (operators && ::chown(settings.socket.c_str(), static_cast<uid_t>(-1), *operators) != 0)
            throw ServeError("server.operator_group: cannot give " + settings.socket +
                             " to group '" + settings.operator_group +
                             "': " + std::strerror(errno));
        if (!settings.status_socket.empty()) open_unix(Door::status, settings.status_socket);
        if (!settings.page.empty())
            page = open_tcp(Door::page, listen_tcp("server.page", settings.page, true));
        if (!settings.remote.empty()) {
            certificates_seen = stamp_of(settings);
            tls.emplace(read_certificates());
            look_at_certificates();
            remote = open_tcp(Door::remote, listen_tcp("server.remote", settings.remote, false));
        }
    }

    void answer() {
        for (Listener& listener : listeners) accept(listener);
        show_life();
        // Signals are for the main thread.
        sigset_t all, before;
        sigfillset(&all);
        pthread_sigmask(SIG_BLOCK, &all, &before);
        thread = std::thread([this] {
            pthread_setname_np(pthread_self(), "server");
            io.run();
        });
        pthread_sigmask(SIG_SETMASK, &before, nullptr);
    }

    ~Impl() {
        io.stop();
        if (thread.joinable()) thread.join();
    }

    void open_unix(Door door, const std::string& path) {
        files.emplace_back(path);
        listeners.emplace_back(io, door, Protocol(AF_UNIX, 0), files.back().release());
    }
    std::string open_tcp(Door door, const TcpListener& opened) {
        const bool v6 = opened.address.front() == '[';
        listeners.emplace_back(io, door, Protocol(v6 ? AF_INET6 : AF_INET, IPPROTO_TCP),
                               opened.descriptor);
        return opened.address;
    }

    [[nodiscard]] asio::ssl::context read_certificates() const {
        return mutual_tls(settings.certificate, settings.key, settings.clients_ca, true,
                          settings.revoked);
    }

    void show_life() {
        source.serving();
        life.expires_after(kLife);
        life.async_wait([this](error_code error) {
            if (!error) show_life();
        });
    }

    /// Takes over renewed certificates and a longer list of revoked ones while it runs.
    void look_at_certificates() {
        certificate_look.expires_after(kCertificateLook);
        certificate_look.async_wait([this](error_code error) {
            if (error) return;
            if (auto stamp = stamp_of(settings); stamp != certificates_seen) {
                certificates_seen = std::move(stamp);
                try {
                    tls.emplace(read_certificates());
                    ++shared.certificates;
                } catch (const ServeError& wrong) {
                    source.refused("server", "changed certificates", wrong.what());
                }
            }
            look_at_certificates();
        });
    }

    void accept(Listener& listener) {
        listener.acceptor.async_accept(
            [this, &listener](error_code error, AnyStream::Socket socket) {
                if (error == asio::error::operation_aborted) return;
                if (error) {
                    // Out of descriptors, mostly: a waiting connection would be reported again at
                    // once.
                    listener.pause.expires_after(kAcceptPause);
                    listener.pause.async_wait([this, &listener](error_code stopped) {
                        if (!stopped) accept(listener);
                    });
                    return;
                }
                welcome(listener.door, std::move(socket));
                accept(listener);
            });
    }

    void welcome(Door door, AnyStream::Socket socket) {
        Caller caller;
        if (door == Door::control || door == Door::status) {
            ucred peer{};
            socklen_t size = sizeof peer;
            peer.uid = static_cast<uid_t>(-1);
            ::getsockopt(socket.native_handle(), SOL_SOCKET, SO_PEERCRED, &peer, &size);
            caller.identity = "uid " + std::to_string(peer.uid);
            caller.role = role_of(door, peer.uid);
        } else {
            error_code error;
            const asio::generic::stream_protocol::endpoint end = socket.remote_endpoint(error);
            if (error) return;
            asio::ip::tcp::endpoint address;
            std::memcpy(address.data(), end.data(), std::min(end.size(), address.capacity()));
            const std::string from = ", from " + address.address().to_string();
            caller.browser = true;
            caller.role = Role::viewer;
            caller.identity = door == Door::page ? "page" + from : from;
            if (door == Door::page) caller.host = page;
            caller.encrypted = door == Door::remote;
            const int on = 1;
            ::setsockopt(socket.native_handle(), IPPROTO_TCP, 1 /* TCP_NODELAY */, &on, sizeof on);
        }
        AnyStream stream =
            caller.encrypted ? AnyStream(std::move(socket), *tls) : AnyStream(std::move(socket));
        serve_connection(std::move(stream), std::move(caller), shared,
                         places[static_cast<std::size_t>(door)]);
    }

    [[nodiscard]] Role role_of(Door door, uid_t uid) const {
        if (door == Door::status) return Role::viewer;
        if (uid == 0 || uid == ::geteuid()) return Role::administer;
        return !operators || is_member(uid, *operators) ? Role::operate : Role::viewer;
    }

    const ServerSettings settings;
    StatusSource& source;
    std::optional<gid_t> operators;
    // Outlive the io_context, whose end destroys the waiting sessions.
    std::deque<SocketFile> files;
    Api api;
    Shared shared{api, settings.limits};
    std::array<Places, 4> places{{{"the control socket", settings.limits.connections},
                                  {"the status socket", settings.limits.connections},
                                  {"the page", settings.limits.connections},
                                  {"server.remote", settings.limits.connections}}};
    std::optional<asio::ssl::context> tls;
    std::string page, remote;
    asio::io_context io{1};
    asio::steady_timer life{io};
    asio::steady_timer certificate_look{io};
    std::string certificates_seen;
    std::deque<Listener> listeners;
    std::thread thread;
};

StatusServer::StatusServer(StatusSource& source, const ServerSettings& settings)
    : impl_(std::make_unique<Impl>(source, settings)) {}

StatusServer::StatusServer(StatusSource& source, const std::string& path,
                           const ServerLimits& limits)
    : StatusServer(source, ServerSettings{path, {}, {}, {}, {}, {}, {}, {}, {}, limits}) {
    answer();
}

void StatusServer::answer() { impl_->answer(); }

StatusServer::~StatusServer() = default;

std::string StatusServer::page_address() const {
    return impl_->page.empty() ? "" : "http://" + impl_->page + "/";
}
std::string StatusServer::remote_address() const {
    return impl_->remote.empty() ? "" : "https://" + impl_->remote + "/";
}

}  // namespace vibrig::serve
