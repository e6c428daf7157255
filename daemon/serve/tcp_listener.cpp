#include "daemon/serve/tcp_listener.hpp"

#include <arpa/inet.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <memory>
#include <system_error>

#include "daemon/serve/socket_file.hpp"

namespace vibrig::serve {
namespace {

constexpr int kTcpBacklog = 256;

bool is_loopback(const sockaddr* address) {
    if (address->sa_family == AF_INET) {
        const auto* v4 = reinterpret_cast<const sockaddr_in*>(address);
        return (ntohl(v4->sin_addr.s_addr) >> 24) == 127;
    }
    const auto* v6 = reinterpret_cast<const sockaddr_in6*>(address);
    return IN6_IS_ADDR_LOOPBACK(&v6->sin6_addr) != 0;
}

}  // namespace

TcpListener listen_tcp(const std::string& key, const std::string& address, bool loopback_only) {
    const auto fail = [&](const std::string& what) {
        throw ServeError(key + ": found '" + address + "': " + what);
    };
    const std::size_t colon = address.rfind(':');
    if (colon == std::string::npos || colon == 0) fail("expected HOST:PORT");
    std::string host = address.substr(0, colon);
    if (host.size() > 2 && host.front() == '[' && host.back() == ']')
        host = host.substr(1, host.size() - 2);
    addrinfo hints{};
    hints.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
    hints.ai_socktype = SOCK_STREAM;
    addrinfo* list = nullptr;
    if (const int error = ::getaddrinfo(host.c_str(), address.c_str() + colon + 1, &hints, &list)) {
        fail(::gai_strerror(error));
    }
    const std::unique_ptr<addrinfo, void (*)(addrinfo*)> found(list, ::freeaddrinfo);
    if (loopback_only && !is_loopback(found->ai_addr))
        fail("expected an address of this machine's loopback: 127.0.0.1 or [::1]");
    const int fd = ::socket(found->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    const int on = 1;
    // At boot the machine's address may come after this program, or much later; until then the door
    // is shut, which is watched and shown.
    if (fd >= 0 && !loopback_only) ::setsockopt(fd, SOL_IP, IP_FREEBIND, &on, sizeof on);
    if (fd < 0 || ::setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) != 0 ||
        ::bind(fd, found->ai_addr, found->ai_addrlen) != 0 || ::listen(fd, kTcpBacklog) != 0) {
        const std::string why = std::generic_category().message(errno);
        if (fd >= 0) ::close(fd);
        fail("cannot listen: " + why);
    }
    sockaddr_storage bound{};
    socklen_t size = sizeof bound;
    std::array<char, NI_MAXHOST> name{};
    std::array<char, NI_MAXSERV> port{};
    if (::getsockname(fd, reinterpret_cast<sockaddr*>(&bound), &size) != 0 ||
        ::getnameinfo(reinterpret_cast<sockaddr*>(&bound), size, name.data(), name.size(),
                      port.data(), port.size(), NI_NUMERICHOST | NI_NUMERICSERV) != 0) {
        ::close(fd);
        fail("cannot tell the port");
    }
    const std::string number = name.data();
    const bool v6 = number.find(':') != std::string::npos;
    return {fd, (v6 ? "[" + number + "]" : number) + ":" + port.data()};
}

}  // namespace vibrig::serve
