#pragma once

#include <linux/can.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <optional>
#include <stdexcept>
#include <string>

namespace vibrig::plant {

/// A plain client of the seqpacket bus, as any program would write it. A read gives up after 5 s.
class BusClient {
  public:
    explicit BusClient(const std::string& path)
        : fd_(socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0)) {
        sockaddr_un address{};
        address.sun_family = AF_UNIX;
        path.copy(address.sun_path, sizeof(address.sun_path) - 1);
        const timeval patience{5, 0};
        setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
        if (connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
            throw std::runtime_error("cannot connect to " + path);
        }
    }
    ~BusClient() { close(fd_); }
    BusClient(const BusClient&) = delete;
    BusClient& operator=(const BusClient&) = delete;

    [[nodiscard]] std::optional<can_frame> read(int flags = 0) {
        can_frame frame{};
        if (recv(fd_, &frame, sizeof(frame), flags) != CAN_MTU) return std::nullopt;
        return frame;
    }
    void write(const can_frame& frame) { write_bytes(&frame, CAN_MTU); }
    void write_bytes(const void* data, std::size_t size) {
        if (send(fd_, data, size, MSG_NOSIGNAL) < 0) throw std::runtime_error("cannot send");
    }

  private:
    int fd_;
};

}  // namespace vibrig::plant
