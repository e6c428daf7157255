#include "daemon/serve/own_connection.hpp"

#include <netdb.h>
#include <netinet/in.h>
#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <memory>
#include <system_error>
#include <utility>

namespace vibrig::serve {
namespace {

const sockaddr* generic(const sockaddr_storage& address) {
    return reinterpret_cast<const sockaddr*>(&address);
}

void instead_of_any(sockaddr_storage& address) {
    if (address.ss_family == AF_INET) {
        auto* v4 = reinterpret_cast<sockaddr_in*>(&address);
        if (v4->sin_addr.s_addr == htonl(INADDR_ANY)) v4->sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    } else {
        auto* v6 = reinterpret_cast<sockaddr_in6*>(&address);
        if (IN6_IS_ADDR_UNSPECIFIED(&v6->sin6_addr) != 0) v6->sin6_addr = in6addr_loopback;
    }
}

bool same(const sockaddr_storage& a, const sockaddr_storage& b) {
    if (a.ss_family != b.ss_family) return false;
    if (a.ss_family == AF_INET) {
        const auto* x = reinterpret_cast<const sockaddr_in*>(&a);
        const auto* y = reinterpret_cast<const sockaddr_in*>(&b);
        return x->sin_port == y->sin_port && x->sin_addr.s_addr == y->sin_addr.s_addr;
    }
    const auto* x = reinterpret_cast<const sockaddr_in6*>(&a);
    const auto* y = reinterpret_cast<const sockaddr_in6*>(&b);
    return x->sin6_port == y->sin6_port &&
           std::memcmp(&x->sin6_addr, &y->sin6_addr, sizeof x->sin6_addr) == 0;
}

}  // namespace

OwnConnection::OwnConnection(const std::string& address) {
    const std::size_t colon = address.rfind(':');
    std::string host = address.substr(0, colon);
    if (host.front() == '[') host = host.substr(1, host.size() - 2);
    addrinfo hints{};
    hints.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV;
    hints.ai_socktype = SOCK_STREAM;
    addrinfo* list = nullptr;
    if (::getaddrinfo(host.c_str(), address.c_str() + colon + 1, &hints, &list) != 0) return;
    const std::unique_ptr<addrinfo, void (*)(addrinfo*)> found(list, ::freeaddrinfo);
    std::memcpy(&door_, found->ai_addr, found->ai_addrlen);
    door_size_ = found->ai_addrlen;
    instead_of_any(door_);
}

void OwnConnection::close() noexcept {
    if (descriptor_ >= 0) ::close(std::exchange(descriptor_, -1));
}

void OwnConnection::begin() noexcept {
    close();
    arrived_ = false;
    error_ = 0;
    descriptor_ = ::socket(door_.ss_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (descriptor_ < 0) return;  // no descriptor left: that says nothing about the door
    // Reset at its end: a minute of TIME_WAIT each second is none.
    const linger none{1, 0};
    ::setsockopt(descriptor_, SOL_SOCKET, SO_LINGER, &none, sizeof none);
    if (::connect(descriptor_, generic(door_), door_size_) != 0 && errno != EINPROGRESS)
        error_ = errno;
}

bool OwnConnection::is_mine(const sockaddr_storage& from) noexcept {
    sockaddr_storage own{};
    socklen_t size = sizeof own;
    if (descriptor_ < 0 || arrived_ ||
        ::getsockname(descriptor_, reinterpret_cast<sockaddr*>(&own), &size) != 0 ||
        !same(own, from))
        return false;
    arrived_ = true;
    close();
    return true;
}

std::string OwnConnection::problem() const {
    if (arrived_ || descriptor_ < 0) return {};
    int error = error_;
    socklen_t size = sizeof error;
    if (error == 0) ::getsockopt(descriptor_, SOL_SOCKET, SO_ERROR, &error, &size);
    if (error != 0) return "takes no connection: " + std::generic_category().message(error);
    pollfd look{descriptor_, POLLOUT, 0};
    const bool connected = ::poll(&look, 1, 0) == 1 && (look.revents & POLLOUT) != 0;
    return connected ? "leads elsewhere: a connection of our own does not come here"
                     : "takes no connection: no answer";
}

}  // namespace vibrig::serve
