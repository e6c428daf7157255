#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <ctime>

#include "tests/plant/bus.hpp"
#include "tests/plant/seqpacket_hub.hpp"
#include "tests/plant/truth.hpp"

namespace vibrig::plant {
namespace {

/// A socket of the rig's own on a CAN interface of the kernel.
class SocketCanBus final : public Bus {
  public:
    explicit SocketCanBus(const std::string& interface) : interface_(interface) {
        if (if_nametoindex(interface.c_str()) == 0) {
            throw PlantError("--can " + interface + ": " + std::strerror(errno) +
                             ", expected a CAN interface or seqpacket:PATH");
        }
        fd_ = socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
        const int on = 1;
        const int size = 1 << 20;
        if (fd_ >= 0) {
            setsockopt(fd_, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof(on));
            setsockopt(fd_, SOL_SOCKET, SO_SNDBUF, &size, sizeof(size));
        }
        if (fd_ < 0 || !bind_to_interface()) {
            const std::string reason = std::strerror(errno);
            if (fd_ >= 0) close(fd_);
            throw PlantError("--can " + interface + ": cannot open: " + reason);
        }
    }
    ~SocketCanBus() override { close(fd_); }
    SocketCanBus(const SocketCanBus&) = delete;
    SocketCanBus& operator=(const SocketCanBus&) = delete;

    [[nodiscard]] int descriptor() const noexcept override { return fd_; }
    [[nodiscard]] bool only_newcomers() const noexcept override { return false; }  // cannot know
    [[nodiscard]] bool somebody_there() const noexcept override { return true; }
    [[nodiscard]] std::uint64_t dropped() const noexcept override { return dropped_; }

    void receive(const Handler& on_frame) override {
        for (std::size_t i = 0; i < kBatch; ++i) {
            canfd_frame frame{};
            const ssize_t size = recv(fd_, &frame, sizeof(frame), 0);
            if (size < 0) return;
            on_frame(frame);
        }
    }

    void send(std::span<const can_frame> frames, bool wait) override {
        std::array<mmsghdr, kBatch> messages{};
        std::array<iovec, kBatch> vectors{};
        int patience = 1000;
        while (!frames.empty()) {
            const std::size_t n = std::min(frames.size(), kBatch);
            for (std::size_t i = 0; i < n; ++i) {
                vectors[i] = {const_cast<can_frame*>(&frames[i]), CAN_MTU};
                messages[i] = {};
                messages[i].msg_hdr.msg_iov = &vectors[i];
                messages[i].msg_hdr.msg_iovlen = 1;
            }
            const int sent = sendmmsg(fd_, messages.data(), static_cast<unsigned>(n), 0);
            if (sent > 0) {
                frames = frames.subspan(static_cast<std::size_t>(sent));
                continue;
            }
            if (errno == EINTR) continue;
            // The queue of the device is full (ENOBUFS): poll cannot tell when it is not any more.
            if ((errno == EAGAIN || errno == ENOBUFS) && wait && patience-- > 0) {
                const timespec pause{0, 1'000'000};
                nanosleep(&pause, nullptr);
                continue;
            }
            dropped_ += frames.size();  // ENETDOWN and the like: the interface may come back
            // One that was deleted comes back as another.
            if (errno == ENXIO || errno == ENODEV) static_cast<void>(bind_to_interface());
            return;
        }
    }

  private:
    [[nodiscard]] bool bind_to_interface() const noexcept {
        sockaddr_can address{};
        address.can_family = AF_CAN;
        address.can_ifindex = static_cast<int>(if_nametoindex(interface_.c_str()));
        const can_filter all{0, 0};  // the kernel forgets filters with the interface
        setsockopt(fd_, SOL_CAN_RAW, CAN_RAW_FILTER, &all, sizeof(all));
        return address.can_ifindex != 0 &&
               bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
    }

    std::string interface_;
    int fd_ = -1;
    std::uint64_t dropped_ = 0;
};

}  // namespace

std::unique_ptr<Bus> open_bus(const std::string& address) {
    const std::string prefix = "seqpacket:";
    if (address.starts_with(prefix))
        return std::make_unique<SeqpacketHub>(address.substr(prefix.size()));
    return std::make_unique<SocketCanBus>(address);
}

}  // namespace vibrig::plant
