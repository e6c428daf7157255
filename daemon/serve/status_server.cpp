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
#include <ctime>
#include <deque>
#include <functional>
#include <optional>
#include <random>
#include <thread>
#include <utility>
#include <vector>

#include "daemon/serve/command_queue.hpp"
#include "daemon/serve/expiry_watch.hpp"
#include "daemon/serve/own_connection.hpp"
#include "daemon/serve/session.hpp"
#include "daemon/serve/tcp_listener.hpp"
#include "daemon/serve/tls.hpp"

namespace vibrig::serve {
namespace {

namespace asio = boost::asio;
using Protocol = asio::generic::stream_protocol;
using boost::system::error_code;

constexpr auto kAcceptPause = std::chrono::milliseconds(100);
constexpr auto kCertificatePeriod = std::chrono::seconds(1);
constexpr auto kLife = std::chrono::milliseconds(500);
constexpr auto kDoorPeriod = std::chrono::seconds(1);
constexpr std::array<const char*, 4> kDoorNames{"control", "status", "page", "remote"};

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

gid_t group_named(const std::string& name) {
    const group* const found = ::getgrnam(name.c_str());
    if (found == nullptr)
        throw ServeError("server.operator_group: found \"" + name +
                         "\", expected a group of this machine");
    return found->gr_gid;
}

struct StatusServer::Impl {
    enum class Door : std::uint8_t { control, status, page, remote };

    struct Listener {
        Listener(asio::io_context& io, Door which, const Protocol& protocol, int descriptor)
            : door(which), acceptor(io), pause(io) {
            acceptor.assign(protocol, descriptor);
        }
        Door door;
        std::optional<SocketFile> file;      ///< of a Unix socket
        std::optional<OwnConnection> probe;  ///< of a TCP door
        std::string address;                 ///< of that, HOST:PORT
        int misses = 0;                      ///< of the probe, in a row
        bool paused = false;                 ///< out of descriptors, mostly
        ServerStatus::Door shown;
        asio::basic_socket_acceptor<Protocol> acceptor;
        asio::steady_timer pause;
    };

    Impl(StatusSource& from, const ServerSettings& given)
        : settings(given),
          source(from),
          api(from, random_instance(),
              [this](CommandRequest request, std::function<void(CommandReply)> done) {
                  return carry_out(std::move(request), std::move(done));
              }) {
        if (!settings.operator_group.empty()) operators = group_named(settings.operator_group);
        if (settings.documents) api.show(settings.documents);
        if (!settings.socket.empty()) open_unix(Door::control, settings.socket);
        if (!settings.status_socket.empty()) open_unix(Door::status, settings.status_socket);
        if (!settings.page.empty())
            page = open_tcp(Door::page, listen_tcp("server.page", settings.page, true));
        if (!settings.remote.empty()) {
            certificates_seen = stamp_of(settings);
            shared.tls = std::make_shared<asio::ssl::context>(read_certificates());
            read_ends();
            check_certificates();
            remote = open_tcp(Door::remote, listen_tcp("server.remote", settings.remote, false));
        }
    }

    void answer() {
        for (Listener& listener : listeners) accept(listener);
        commands.emplace(source);
        api.history().expect(source.plan());
        show_life();
        check_doors();
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
        commands.reset();
    }

    /// Throws ServeError.
    [[nodiscard]] SocketFile make_socket(Door door, const std::string& path) const {
        SocketFile file(path);
        if (door == Door::control && operators &&
            ::chown(path.c_str(), static_cast<uid_t>(-1), *operators) != 0)
            throw ServeError("server.operator_group: cannot give " + path + " to group '" +
                             settings.operator_group + "': " + std::strerror(errno));
        return file;
    }
    void open_unix(Door door, const std::string& path) {
        SocketFile file = make_socket(door, path);
        Listener& made = listeners.emplace_back(io, door, Protocol(AF_UNIX, 0), file.release());
        made.file.emplace(std::move(file));
        made.shown.address = path;
    }

    /// A stop goes past all that waits; the rest must not hold up who comes next.
    bool carry_out(CommandRequest request, std::function<void(CommandReply)> done) {
        if (request.kind == CommandRequest::Kind::abort) {
            commands->refuse_waiting("a stop came before it");
            done(source.command(request));
            return true;
        }
        return commands->put(
            std::move(request), [this, done = std::move(done)](CommandReply reply) mutable {
                // With `done` goes the last of its session: it ends on the server's thread.
                asio::post(io, [done = std::move(done), reply = std::move(reply)]() mutable {
                    done(std::move(reply));
                });
            });
    }

    /// A door that nobody finds is no door: whoever removed it, it is made anew.
    void check_doors() {
        for (Listener& listener : listeners) listener.file ? check(listener) : check_tcp(listener);
        door_timer.expires_after(kDoorPeriod);
        door_timer.async_wait([this](error_code error) {
            if (!error) check_doors();
        });
    }
    void check(Listener& listener) {
        ServerStatus::Door& shown = listener.shown;
        const std::string wrong = listener.file->problem();
        if (wrong.empty()) {
            shown.open = true;
            shown.note.clear();
            return;
        }
        const std::string door = std::string(kDoorNames[static_cast<std::size_t>(listener.door)]) +
                                 " socket " + shown.address;
        try {
            SocketFile::make_room(shown.address);
            SocketFile fresh = make_socket(listener.door, shown.address);
            error_code ignored;
            listener.acceptor.close(ignored);
            listener.acceptor.assign(Protocol(AF_UNIX, 0), fresh.release());
            listener.file.emplace(std::move(fresh));
            accept(listener);
            source.log_event(Severity::alarm, shown.open ? door + ' ' + wrong + ": made anew"
                                                         : door + ": made anew at last");
            shown.open = true;
            shown.note.clear();
            ++shown.made_anew;
        } catch (const std::exception& error) {
            if (shown.open || shown.note != error.what())
                source.log_event(Severity::alarm, door + (shown.open ? ' ' + wrong : "") +
                                                      " and cannot be made anew: " + error.what());
            shown.open = false;
            shown.note = error.what();
        }
    }

    static Protocol tcp(const std::string& address) {
        return {address.front() == '[' ? AF_INET6 : AF_INET, IPPROTO_TCP};
    }
    std::string open_tcp(Door door, const TcpListener& opened) {
        Listener& made = listeners.emplace_back(io, door, tcp(opened.address), opened.descriptor);
        made.shown.address = (door == Door::remote ? "https://" : "http://") + opened.address + '/';
        made.address = opened.address;
        made.probe.emplace(opened.address);
        return opened.address;
    }
    /// As a Unix door, but what a connection comes to is known a check later; and one that is late
    /// may have been held up by this thread itself.
    void check_tcp(Listener& listener) {
        constexpr int kMisses = 2;
        ServerStatus::Door& shown = listener.shown;
        const std::string door = std::string(kDoorNames[static_cast<std::size_t>(listener.door)]) +
                                 " door " + shown.address;
        const std::string wrong = listener.paused ? "" : listener.probe->problem();
        if (!wrong.empty()) {
            if (++listener.misses >= kMisses) make_tcp_anew(listener, door, wrong);
        } else if (listener.probe->arrived()) {
            if (!shown.open) source.log_event(Severity::alarm, door + " takes connections again");
            listener.misses = 0;
            shown.open = true;
            shown.note.clear();
        }
        listener.probe->begin();
    }
    void make_tcp_anew(Listener& listener, const std::string& door, const std::string& wrong) {
        ServerStatus::Door& shown = listener.shown;
        std::string note = wrong;
        error_code ignored;
        listener.acceptor.close(ignored);  // it holds the port
        listener.pause.cancel(ignored);
        try {
            const TcpListener fresh =
                listen_tcp(listener.door == Door::page ? "server.page" : "server.remote",
                           listener.address, listener.door == Door::page);
            listener.acceptor.assign(tcp(fresh.address), fresh.descriptor);
            accept(listener);
            if (shown.open) source.log_event(Severity::alarm, door + ' ' + wrong + ": made anew");
            ++shown.made_anew;
        } catch (const std::exception& error) {
            note = error.what();
            if (shown.open || shown.note != note)
                source.log_event(Severity::alarm,
                                 door + ' ' + wrong + " and cannot be made anew: " + note);
        }
        // It counts as open when a connection has come through.
        shown.open = false;
        shown.note = note;
    }

    [[nodiscard]] asio::ssl::context read_certificates() const {
        return mutual_tls(settings.certificate, settings.key, settings.clients_ca, true,
                          settings.revoked, true);
    }

    /// Throws ServeError.
    void read_ends() {
        own_ends = {{"server", expiry_of(settings.certificate, true), true},
                    {"authority", expiry_of(settings.clients_ca, false), true}};
    }

    [[nodiscard]] ServerStatus server_status() {
        ServerStatus status;
        for (const Listener& listener : listeners) {
            status.doors.push_back(listener.shown);
            status.doors.back().name = kDoorNames[static_cast<std::size_t>(listener.door)];
        }
        status.certificates = own_ends;
        std::erase_if(shared.clients, [](const auto& client) { return client.expired(); });
        for (const auto& client : shared.clients) {
            const auto one = client.lock();
            const auto same = [&one](const auto& known) { return known.whose == one->whose; };
            if (one && std::ranges::none_of(status.certificates, same))
                status.certificates.push_back(*one);
        }
        return status;
    }

    void show_life() {
        const ServerStatus status = server_status();
        api.history().add(source.serving(status));
        const auto now = static_cast<std::int64_t>(std::time(nullptr));
        for (const auto& certificate : status.certificates) {
            const auto words = expiry_watch.check(
                (certificate.own ? "certificate of the " : "") + certificate.whose,
                certificate.expires, now);
            if (!words.empty()) source.log_event(Severity::alarm, words);
        }
        life.expires_after(kLife);
        life.async_wait([this](error_code error) {
            if (!error) show_life();
        });
    }

    /// Takes over renewed certificates and a longer list of revoked ones while it runs.
    void check_certificates() {
        certificate_timer.expires_after(kCertificatePeriod);
        certificate_timer.async_wait([this](error_code error) {
            if (error) return;
            if (auto stamp = stamp_of(settings); stamp != certificates_seen) {
                certificates_seen = std::move(stamp);
                try {
                    auto renewed = std::make_shared<asio::ssl::context>(read_certificates());
                    read_ends();
                    shared.tls = std::move(renewed);
                } catch (const ServeError& wrong) {
                    source.refused("server", "changed certificates", wrong.what());
                }
            }
            check_certificates();
        });
    }

    void accept(Listener& listener) {
        listener.acceptor.async_accept(
            [this, &listener](error_code error, AnyStream::Socket socket) {
                if (error == asio::error::operation_aborted) return;
                if (error) {
                    // Out of descriptors, mostly: a waiting connection would be reported again at
                    // once.
                    listener.paused = error == asio::error::no_descriptors;
                    listener.pause.expires_after(kAcceptPause);
                    listener.pause.async_wait([this, &listener](error_code stopped) {
                        if (!stopped && listener.acceptor.is_open()) accept(listener);
                    });
                    return;
                }
                listener.paused = false;
                if (!is_probe(listener, socket)) welcome(listener.door, std::move(socket));
                accept(listener);
            });
    }

    static bool is_probe(Listener& listener, const AnyStream::Socket& socket) {
        if (!listener.probe) return false;
        error_code error;
        const Protocol::endpoint end = socket.remote_endpoint(error);
        sockaddr_storage from{};
        std::memcpy(&from, end.data(), std::min<std::size_t>(end.size(), sizeof from));
        return !error && listener.probe->is_mine(from);
    }

    void welcome(Door door, AnyStream::Socket socket) {
        // Gone again without a word, as check() is.
        char nothing = 0;
        if (::recv(socket.native_handle(), &nothing, 1, MSG_PEEK | MSG_DONTWAIT) == 0) return;
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
        AnyStream stream = caller.encrypted ? AnyStream(std::move(socket), *shared.tls)
                                            : AnyStream(std::move(socket));
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
    // Outlives the io_context, whose end destroys the waiting sessions.
    Api api;
    Shared shared{api, settings.limits};
    std::array<Places, 4> places{{{"the control socket", settings.limits.connections},
                                  {"the status socket", settings.limits.connections},
                                  {"the page", settings.limits.connections},
                                  {"server.remote", settings.limits.connections}}};
    std::string page, remote;
    asio::io_context io{1};
    asio::steady_timer life{io};
    asio::steady_timer certificate_timer{io};
    asio::steady_timer door_timer{io};
    std::string certificates_seen;
    std::vector<CertificateStatus> own_ends;
    ExpiryWatch expiry_watch;
    std::deque<Listener> listeners;
    std::optional<CommandQueue> commands;  ///< since somebody answers them
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
