#include "daemon/lock/rig_lock.hpp"

#include <netdb.h>
#include <poll.h>
#include <spdlog/fmt/chrono.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <functional>
#include <string_view>
#include <system_error>

namespace vibrig {

namespace {

// How long a holder may take to say who it is; it looks once a second.
constexpr int kPatience_ms = 3000;
constexpr int kBacklog = 1024;

struct Address {
    sockaddr_un name{};
    socklen_t size = 0;
};

/// An abstract name; one that is too long is cut and distinguished by its hash.
Address address_of(const std::string& resource) {
    std::string text = "vibrig-rig/" + resource;
    constexpr std::size_t kMost = sizeof(sockaddr_un::sun_path) - 1;
    if (text.size() > kMost) {
        const auto hash = fmt::format("#{:016x}", std::hash<std::string>{}(text));
        text = text.substr(0, kMost - hash.size()) + hash;
    }
    Address address;
    address.name.sun_family = AF_UNIX;
    std::ranges::copy(text, address.name.sun_path + 1);
    address.size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + text.size());
    return address;
}

std::string absolute(const std::string& path) {
    if (path.starts_with('@')) return path;
    std::error_code error;
    const auto found = std::filesystem::weakly_canonical(path, error);
    return error ? path : found.string();
}

std::string in_lower_case(std::string text) {
    std::ranges::transform(text, text.begin(), [](unsigned char c) { return std::tolower(c); });
    return text;
}

/// One spelling of the address that the name leads to now; where it leads nowhere, the name.
std::string host_of(std::string host) {
    host = in_lower_case(host);
    addrinfo hints{};
    hints.ai_family = AF_UNSPEC;
    hints.ai_socktype = SOCK_STREAM;
    addrinfo* found = nullptr;
    if (::getaddrinfo(host.c_str(), nullptr, &hints, &found) != 0) return host;
    std::array<char, NI_MAXHOST> text{};
    // The first, which is the one that is connected to.
    if (::getnameinfo(found->ai_addr, found->ai_addrlen, text.data(), text.size(), nullptr, 0,
                      NI_NUMERICHOST) == 0)
        host = text.data();
    ::freeaddrinfo(found);
    // An IPv4 address written as IPv6 leads to the same peer, the unspecified one to this machine.
    constexpr std::string_view kMapped = "::ffff:";
    if (host.starts_with(kMapped) && host.find('.') != std::string::npos)
        host.erase(0, kMapped.size());
    return host == "::1" || host == "::" || host == "0.0.0.0" ? "127.0.0.1" : host;
}

int make_socket() {
    const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0) throw std::system_error(errno, std::generic_category(), "lock of the rig");
    return fd;
}

/// What the holder says of itself, or else what the kernel knows.
std::string holder_of(const Address& address) {
    const int fd = make_socket();
    std::string words = "another process";
    if (::connect(fd, reinterpret_cast<const sockaddr*>(&address.name), address.size) == 0) {
        ucred peer{};
        socklen_t size = sizeof peer;
        if (::getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0)
            words = fmt::format("pid {}, user {}", peer.pid, peer.uid);
        pollfd events{fd, POLLIN, 0};
        std::array<char, 512> text{};
        ssize_t got = 0;
        if (::poll(&events, 1, kPatience_ms) == 1 &&
            (got = ::recv(fd, text.data(), text.size(), 0)) > 0)
            words += ", " + std::string(text.data(), static_cast<std::size_t>(got));
    }
    ::close(fd);
    return words;
}

}  // namespace

std::vector<std::string> RigLock::resources(const configuration::Configuration& configuration) {
    using drivers::CanPortSettings;
    using drivers::ShakerSettings;
    const auto& can = configuration.can;
    const auto& shaker = configuration.shaker;
    const bool socketcan = can.kind == CanPortSettings::Kind::socketcan;
    const bool tcp = shaker.transport == ShakerSettings::Transport::tcp;
    const std::string port = ":" + std::to_string(shaker.port);
    std::vector<std::string> all{
        "can:" + (socketcan ? can.interface : absolute(can.path)),
        "modbus:" + (tcp ? host_of(shaker.host) + port : absolute(shaker.device))};
    // The name too: it may lead elsewhere the next time, or nowhere.
    if (const auto name = "modbus:" + in_lower_case(shaker.host) + port; tcp && name != all[1])
        all.push_back(name);
    return all;
}

RigLock::RigLock(const configuration::Configuration& configuration, const std::string& path) {
    const auto now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
    words_ = fmt::format("configuration {}, since {:%Y-%m-%dT%H:%M:%SZ}",
                         path.empty() ? "all defaults" : absolute(path), fmt::gmtime(now));
    try {
        for (const auto& resource : resources(configuration)) take(resource);
    } catch (...) {
        for (const int fd : sockets_) ::close(fd);
        throw;
    }
}

RigLock::~RigLock() {
    for (const int fd : sockets_) ::close(fd);
}

void RigLock::take(const std::string& resource) {
    const Address address = address_of(resource);
    const int fd = make_socket();
    sockets_.push_back(fd);
    if (::bind(fd, reinterpret_cast<const sockaddr*>(&address.name), address.size) == 0 &&
        ::listen(fd, kBacklog) == 0)
        return;
    if (errno != EADDRINUSE)
        throw std::system_error(errno, std::generic_category(), "lock of " + resource);
    throw RigTaken(resource + " is commanded by another vibrigd: " + holder_of(address) +
                   "; expected one daemon for one rig");
}

void RigLock::answer() noexcept {
    for (const int fd : sockets_) {
        for (;;) {
            const int asker = ::accept4(fd, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
            if (asker < 0) break;
            static_cast<void>(
                ::send(asker, words_.data(), words_.size(), MSG_DONTWAIT | MSG_NOSIGNAL));
            ::close(asker);
        }
    }
}

}  // namespace vibrig
