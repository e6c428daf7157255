#include <fcntl.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cctype>
#include <cerrno>
#include <cstring>

#include "drivers/can/can_port_base.hpp"

namespace vibrig::drivers {
namespace {

/// The kernel's CAN_RAW socket on one interface.
class SocketCanPort final : public CanPortBase {
  public:
    SocketCanPort(boost::asio::io_context& io, const CanPortSettings& settings)
        : CanPortBase(io, settings, settings.interface) {}

  private:
    Opened open_socket() noexcept override {
        const int fd = ::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
        if (fd < 0) {
            const int error = errno;
            if (error == EAFNOSUPPORT || error == EPROTONOSUPPORT) {
                return {-1,
                        {PortState::fault, error,
                         "the kernel has no CAN_RAW sockets (module can-raw)", true}};
            }
            const bool forbidden = error == EPERM || error == EACCES;
            return {-1, {PortState::fault, error, "no CAN_RAW socket", forbidden}};
        }
        const Refusal refusal = configure(fd);
        if (refusal.text[0] != '\0') {
            ::close(fd);
            return {-1, refusal};
        }
        return {fd, {}};
    }

    int link_error(int fd) const noexcept override {
        ifreq request = named();
        if (::ioctl(fd, SIOCGIFFLAGS, &request) != 0) return errno;
        if ((static_cast<unsigned>(request.ifr_flags) & IFF_UP) == 0) return ENETDOWN;
        sockaddr_can address{};
        socklen_t length = sizeof address;
        if (::getsockname(fd, reinterpret_cast<sockaddr*>(&address), &length) != 0) return errno;
        if (::ioctl(fd, SIOCGIFINDEX, &request) != 0) return errno;
        return request.ifr_ifindex == address.can_ifindex
                   ? 0
                   : ENODEV;  // made anew under the same name
    }

    [[nodiscard]] ifreq named() const noexcept {
        ifreq request{};
        std::strncpy(request.ifr_name, settings().interface.c_str(), IFNAMSIZ - 1);
        return request;
    }

    Refusal configure(int fd) const noexcept {
        ifreq request = named();
        if (::ioctl(fd, SIOCGIFHWADDR, &request) != 0) {
            return {PortState::absent, errno, "no such interface, waiting"};
        }
        if (request.ifr_hwaddr.sa_family != ARPHRD_CAN) {
            return {PortState::fault, 0, "is not a CAN interface", true};
        }
        if (::ioctl(fd, SIOCGIFFLAGS, &request) != 0) {
            return {PortState::absent, errno, "no such interface, waiting"};
        }
        if ((static_cast<unsigned>(request.ifr_flags) & IFF_UP) == 0) {
            return {PortState::connecting, ENETDOWN, "down, waiting"};
        }
        const int on = 1;
        const can_err_mask_t every_error = CAN_ERR_MASK;
        set_common_options(fd);
        if (::setsockopt(fd, SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, &on, sizeof on) != 0 ||
            ::setsockopt(fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &every_error, sizeof every_error) !=
                0 ||
            ::setsockopt(fd, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on) != 0 ||
            (settings().fd &&
             ::setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on) != 0)) {
            return {PortState::fault, errno, "the kernel refuses a CAN_RAW option", true};
        }
        // The index, not the name, is what a socket is bound to: an interface made anew has another
        // one.
        if (::ioctl(fd, SIOCGIFINDEX, &request) != 0) {
            return {PortState::absent, errno, "no such interface, waiting"};
        }
        sockaddr_can address{};
        address.can_family = AF_CAN;
        address.can_ifindex = request.ifr_ifindex;
        if (::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
            return {PortState::connecting, errno, "cannot be bound, waiting"};
        }
        return {};
    }
};

}  // namespace

std::unique_ptr<CanPort> make_socketcan_port(boost::asio::io_context& io,
                                             const CanPortSettings& settings) {
    const std::string& name = settings.interface;
    bool valid = !name.empty() && name.size() < IFNAMSIZ && name != "." && name != "..";
    for (const char c : name) {
        valid = valid && c != '/' && c != ':' && std::isspace(static_cast<unsigned char>(c)) == 0 &&
                c != '\0';
    }
    if (!valid) {
        throw CanError("CAN interface: found \"" + name +
                       "\", expected a network interface's name of 1 to " +
                       std::to_string(IFNAMSIZ - 1) + " characters, such as can0");
    }
    return std::make_unique<SocketCanPort>(io, settings);
}

}  // namespace vibrig::drivers
