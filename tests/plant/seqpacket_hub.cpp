#include "tests/plant/seqpacket_hub.hpp"

#include <poll.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <cstring>

#include "tests/plant/truth.hpp"

namespace vibrig::plant {
namespace {

constexpr int kPatienceMs = 1000;

struct Address {
    sockaddr_un un{};
    socklen_t length = 0;
};

Address address_of(const std::string& path) {
    Address address;
    address.un.sun_family = AF_UNIX;
    if (path.empty() || path.size() >= sizeof(address.un.sun_path)) {
        throw PlantError("seqpacket:" + path + ": found a path of " + std::to_string(path.size()) +
                         " characters, expected 1 to " +
                         std::to_string(sizeof(address.un.sun_path) - 1));
    }
    path.copy(address.un.sun_path, path.size());
    const bool abstract = path.front() == '@';
    if (abstract) address.un.sun_path[0] = '\0';
    address.length =
        static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + path.size() + (abstract ? 0 : 1));
    return address;
}

// Left behind by a rig that was killed: nobody accepts on it any more.
bool is_stale_socket(const std::string& path, const Address& address) {
    struct stat status {};
    if (path.front() == '@' || lstat(path.c_str(), &status) != 0 || !S_ISSOCK(status.st_mode))
        return false;
    const int probe = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    const bool refused =
        connect(probe, reinterpret_cast<const sockaddr*>(&address.un), address.length) != 0 &&
        errno == ECONNREFUSED;
    close(probe);
    return refused;
}

}  // namespace

SeqpacketHub::SeqpacketHub(const std::string& path) : path_(path) {
    const Address address = address_of(path);
    if (is_stale_socket(path, address)) unlink(path.c_str());
    listener_ = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (listener_ < 0 ||
        bind(listener_, reinterpret_cast<const sockaddr*>(&address.un), address.length) != 0 ||
        listen(listener_, 16) != 0) {
        const std::string reason = std::strerror(errno);
        if (listener_ >= 0) close(listener_);
        throw PlantError("seqpacket:" + path + ": cannot listen: " + reason);
    }
    epoll_ = epoll_create1(EPOLL_CLOEXEC);
    epoll_event event{};
    event.events = EPOLLIN;
    event.data.fd = listener_;
    epoll_ctl(epoll_, EPOLL_CTL_ADD, listener_, &event);
}

SeqpacketHub::~SeqpacketHub() {
    for (const int fd : clients_) close(fd);
    close(epoll_);
    close(listener_);
    if (path_.front() != '@') unlink(path_.c_str());
}

void SeqpacketHub::accept_clients() {
    for (;;) {
        const int fd = accept4(listener_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
        if (fd < 0) return;
        const int size = 1 << 20;
        setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &size, sizeof(size));
        epoll_event event{};
        event.events = EPOLLIN;
        event.data.fd = fd;
        epoll_ctl(epoll_, EPOLL_CTL_ADD, fd, &event);
        clients_.push_back(fd);
        ++connections_;
    }
}

void SeqpacketHub::drop_client(int fd) {
    std::erase(clients_, fd);
    std::erase(served_, fd);
    close(fd);  // takes it out of the epoll set
}

void SeqpacketHub::receive(const Handler& on_frame) {
    std::array<epoll_event, 16> events{};
    const int count = epoll_wait(epoll_, events.data(), static_cast<int>(events.size()), 0);
    for (int i = 0; i < count; ++i) {
        const int fd = events[static_cast<std::size_t>(i)].data.fd;
        if (fd == listener_) {
            accept_clients();
        } else if (!read_client(fd, on_frame)) {
            drop_client(fd);
        }
    }
}

bool SeqpacketHub::read_client(int fd, const Handler& on_frame) {
    std::array<canfd_frame, kBatch> frames{};
    std::array<mmsghdr, kBatch> messages{};
    std::array<iovec, kBatch> vectors{};
    for (std::size_t i = 0; i < kBatch; ++i) {
        vectors[i] = {&frames[i], sizeof(canfd_frame)};
        messages[i].msg_hdr.msg_iov = &vectors[i];
        messages[i].msg_hdr.msg_iovlen = 1;
    }
    const int count = recvmmsg(fd, messages.data(), kBatch, MSG_TRUNC, nullptr);
    if (count < 0) return errno == EAGAIN || errno == EINTR;
    for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
        const canfd_frame& frame = frames[i];
        const std::size_t bytes = messages[i].msg_len;
        if (bytes == 0) return false;
        if (bytes != CAN_MTU && bytes != CANFD_MTU)
            continue;  // no frame: dropped like noise on a wire
        for (const int other : clients_) {
            if (other != fd && ::send(other, &frame, bytes, MSG_NOSIGNAL) < 0) ++dropped_;
        }
        if (frame.len <= (bytes == CAN_MTU ? CAN_MAX_DLEN : CANFD_MAX_DLEN)) on_frame(frame);
    }
    return true;  // the rest next time: epoll is level-triggered
}

void SeqpacketHub::send(std::span<const can_frame> frames, bool wait) {
    const std::vector<int> clients = clients_;  // one that does not read is dropped on the way
    for (const int fd : clients) send_to(fd, frames, wait);
    served_ = clients_;
}

void SeqpacketHub::send_to(int fd, std::span<const can_frame> frames, bool wait) {
    std::array<mmsghdr, kBatch> messages{};
    std::array<iovec, kBatch> vectors{};
    while (!frames.empty()) {
        const std::size_t n = std::min(frames.size(), kBatch);
        for (std::size_t i = 0; i < n; ++i) {
            vectors[i] = {const_cast<can_frame*>(&frames[i]), CAN_MTU};
            messages[i] = {};
            messages[i].msg_hdr.msg_iov = &vectors[i];
            messages[i].msg_hdr.msg_iovlen = 1;
        }
        const int sent = sendmmsg(fd, messages.data(), static_cast<unsigned>(n), MSG_NOSIGNAL);
        if (sent > 0) {
            frames = frames.subspan(static_cast<std::size_t>(sent));
            continue;
        }
        if (errno == EINTR) continue;
        pollfd full{fd, POLLOUT, 0};
        if (errno == EAGAIN && wait && poll(&full, 1, kPatienceMs) > 0) continue;
        dropped_ += frames.size();
        if (errno != EAGAIN || wait) drop_client(fd);  // gone, or it has not read for a second
        return;
    }
}

}  // namespace vibrig::plant
