#include "tests/bench/bare_receiver.hpp"

#include <pthread.h>
#include <sched.h>
#include <sys/eventfd.h>

#include <array>
#include <atomic>
#include <thread>

namespace vibrig::bench {
namespace {

constexpr int kReceiverPriority = 60, kNextPriority = 50;  // as the daemon's
constexpr std::size_t kBatch = 32;

/// Without the right to it: as any other thread, like the daemon.
void set_priority(int priority) {
    const sched_param wanted{.sched_priority = priority};
    ::pthread_setschedparam(::pthread_self(), SCHED_FIFO, &wanted);
}

int open_bus(const RigBus& bus) {
    int fd = -1;
    if (bus.interface.empty()) {
        fd = ::socket(AF_UNIX, SOCK_SEQPACKET, 0);
        sockaddr_un address{};
        address.sun_family = AF_UNIX;
        bus.path.copy(&address.sun_path[1], sizeof address.sun_path - 1, 1);
        const auto length =
            static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + bus.path.size());
        insist(::connect(fd, reinterpret_cast<const sockaddr*>(&address), length) == 0, "connect");
    } else {
        fd = ::socket(PF_CAN, SOCK_RAW, CAN_RAW);
        sockaddr_can address{};
        address.can_family = AF_CAN;
        address.can_ifindex = static_cast<int>(::if_nametoindex(bus.interface.c_str()));
        insist(::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0,
               "bind");
    }
    constexpr int kOn = 1;
    insist(::setsockopt(fd, SOL_SOCKET, SO_TIMESTAMPNS, &kOn, sizeof kOn) == 0, "stamps");
    return fd;
}

/// Frames that complete a sample among those that have come; < 0: the bus has ended.
class Receiver {
  public:
    explicit Receiver(int fd) : fd_(fd), completes_(RigBus::frames(0).back().frame.can_id) {}

    int take() {
        for (std::size_t i = 0; i < kBatch; ++i) {
            vectors_[i] = {&frames_[i], sizeof frames_[i]};
            headers_[i].msg_hdr = {};
            headers_[i].msg_hdr.msg_iov = &vectors_[i];
            headers_[i].msg_hdr.msg_iovlen = 1;
            headers_[i].msg_hdr.msg_control = control_[i].data();
            headers_[i].msg_hdr.msg_controllen = control_[i].size();
        }
        const int count = ::recvmmsg(fd_, headers_.data(), kBatch, MSG_DONTWAIT, nullptr);
        if (count == 0 || (count > 0 && headers_[0].msg_len == 0)) return -1;
        int complete = 0;
        for (int i = 0; i < count; ++i)
            complete += frames_[static_cast<std::size_t>(i)].can_id == completes_ ? 1 : 0;
        return complete;
    }

  private:
    int fd_;
    canid_t completes_;
    std::array<canfd_frame, kBatch> frames_{};
    std::array<std::array<std::byte, 64>, kBatch> control_{};
    std::array<iovec, kBatch> vectors_{};
    std::array<mmsghdr, kBatch> headers_{};
};

}  // namespace

[[noreturn]] void receive_only(const RigBus& bus) {
    const int fd = open_bus(bus);
    const int event = ::eventfd(0, 0);
    std::atomic<int> cpu{-1};
    std::thread next([&] {
        set_priority(kNextPriority);
        int mine = -1;
        for (;;) {
            std::uint64_t samples = 0;
            if (::read(event, &samples, sizeof samples) < 0) continue;
            if (const int wanted = cpu.load(); wanted != mine) {
                cpu_set_t only;
                CPU_ZERO(&only);
                CPU_SET(static_cast<std::size_t>(wanted), &only);
                ::pthread_setaffinity_np(::pthread_self(), sizeof only, &only);
                mine = wanted;
            }
        }
    });
    set_priority(kReceiverPriority);
    Receiver receiver(fd);
    for (pollfd waits{fd, POLLIN, 0};;) {
        if (::poll(&waits, 1, -1) < 0) continue;
        const int complete = receiver.take();
        if (complete < 0) ::_exit(0);
        if (complete == 0) continue;
        cpu.store(::sched_getcpu());
        const std::uint64_t samples = 1;
        insist(::write(event, &samples, sizeof samples) == sizeof samples, "eventfd");
    }
}

}  // namespace vibrig::bench
