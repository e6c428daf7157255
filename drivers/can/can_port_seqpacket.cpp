#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstring>

#include "drivers/can/can_port_base.hpp"

namespace vibrig::drivers {
namespace {

/// Client of a bus over a Unix SOCK_SEQPACKET socket: each packet is one struct can_frame or struct
/// canfd_frame.
class SeqpacketPort final : public CanPortBase {
  public:
    SeqpacketPort(boost::asio::io_context& io, const CanPortSettings& settings)
        : CanPortBase(io, settings, settings.path) {
        address_.sun_family = AF_UNIX;
        std::memcpy(address_.sun_path, settings.path.data(), settings.path.size());
        length_ = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + settings.path.size());
        if (settings.path.front() == '@') {
            address_.sun_path[0] =
                '\0';  // the abstract name is exactly what follows: no terminator
        } else {
            ++length_;
        }
    }

  private:
    Opened open_socket() noexcept override {
        const int fd = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
        if (fd < 0) return {-1, {PortState::fault, errno, "no Unix socket"}};
        set_common_options(fd);
        // A Unix connect either succeeds or fails at once: a full backlog is EAGAIN, not a
        // connection under way.
        if (::connect(fd, reinterpret_cast<const sockaddr*>(&address_), length_) != 0) {
            const int error = errno;
            ::close(fd);
            switch (error) {
                case ENOENT:
                case ECONNREFUSED:
                    return {-1, {PortState::absent, error, "nobody listens, waiting"}};
                case EACCES:
                case EPERM:
                    return {-1, {PortState::fault, error, "no permission to connect", true}};
                case EPROTOTYPE:
                    return {-1, {PortState::fault, error, "is not a SOCK_SEQPACKET socket", true}};
                default:
                    return {-1, {PortState::connecting, error, "cannot connect, waiting"}};
            }
        }
        return {fd, {}};
    }

    sockaddr_un address_{};
    socklen_t length_ = 0;
};

}  // namespace

std::unique_ptr<CanPort> make_seqpacket_port(boost::asio::io_context& io,
                                             const CanPortSettings& settings) {
    const std::string& path = settings.path;
    const bool absolute = path.starts_with('/');
    if (path.size() < 2 || path.size() >= sizeof(sockaddr_un::sun_path) ||
        (!absolute && !path.starts_with('@')) ||
        (absolute && path.find('\0') != std::string::npos)) {
        throw CanError("CAN bus socket: found \"" + path +
                       "\", expected an absolute path or @name of 2 to " +
                       std::to_string(sizeof(sockaddr_un::sun_path) - 1) + " characters");
    }
    return std::make_unique<SeqpacketPort>(io, settings);
}

}  // namespace vibrig::drivers
