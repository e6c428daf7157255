#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <string>
#include <system_error>

namespace vibrig {

/// A TCP port at an address of the loopback (all that begin with 127) whose host never says a word:
/// it takes connections, or swallows what asks for one.
class MuteHost {
  public:
    enum class Takes { connections, nothing };

    /// Port 0: any that is free.
    explicit MuteHost(const std::string& address, int port = 0, Takes takes = Takes::connections) {
        sockaddr_in place{};
        place.sin_family = AF_INET;
        place.sin_port = htons(static_cast<std::uint16_t>(port));
        ::inet_pton(AF_INET, address.c_str(), &place.sin_addr);
        socklen_t size = sizeof place;
        auto* const generic = reinterpret_cast<sockaddr*>(&place);
        listener_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
        const int on = 1;
        ::setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
        if (::bind(listener_, generic, size) != 0 ||
            ::listen(listener_, takes == Takes::connections ? 8 : 0) != 0 ||
            ::getsockname(listener_, generic, &size) != 0)
            throw std::system_error(errno, std::generic_category(), "mute host " + address);
        port_ = ntohs(place.sin_port);
        if (takes == Takes::connections) return;
        // One fills a queue of that length: who comes later gets no answer from the kernel.
        filler_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
        if (::connect(filler_, generic, size) != 0)
            throw std::system_error(errno, std::generic_category(), "mute host " + address);
    }
    ~MuteHost() {
        if (filler_ >= 0) ::close(filler_);
        ::close(listener_);
    }
    MuteHost(const MuteHost&) = delete;
    MuteHost& operator=(const MuteHost&) = delete;

    [[nodiscard]] int port() const { return port_; }
    /// Somebody has connected; of one that takes connections.
    [[nodiscard]] bool called() const {
        pollfd waiting{listener_, POLLIN, 0};
        return ::poll(&waiting, 1, 0) == 1;
    }

  private:
    int listener_ = -1, filler_ = -1, port_ = 0;
};

}  // namespace vibrig
