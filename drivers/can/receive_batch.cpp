#include "drivers/can/receive_batch.hpp"

#include <algorithm>
#include <cstring>
#include <ctime>

namespace vibrig::drivers {
namespace {

Time read_clock(clockid_t id) noexcept {
    timespec t{};
    ::clock_gettime(id, &t);
    return t.tv_sec * kSecond + t.tv_nsec;
}

}  // namespace

ClockPair ClockPair::now() noexcept {
    ClockPair pair;
    pair.monotonic = read_clock(CLOCK_MONOTONIC);
    pair.realtime = read_clock(CLOCK_REALTIME);
    return pair;
}

Time ClockPair::to_monotonic(Time realtime_stamp) const noexcept {
    const Time age = std::clamp(realtime - realtime_stamp, Time{0}, kSecond);
    return (monotonic - age) / kMicrosecond * kMicrosecond;
}

ReceiveBatch::ReceiveBatch() noexcept {
    for (std::size_t i = 0; i < kCapacity; ++i) {
        vectors_[i] = {&frames_[i], sizeof(canfd_frame)};
        msghdr& header = headers_[i].msg_hdr;
        header.msg_iov = &vectors_[i];
        header.msg_iovlen = 1;
        header.msg_control = &control_[i];
        header.msg_controllen = kControlBytes;
    }
}

int ReceiveBatch::receive(int fd) noexcept {
    for (std::size_t i = 0; i < touched_; ++i) headers_[i].msg_hdr.msg_controllen = kControlBytes;
    const int count = ::recvmmsg(fd, headers_.data(), kCapacity, MSG_DONTWAIT, nullptr);
    // A failed call may have overwritten the first header.
    touched_ = count > 0 ? std::min(static_cast<std::size_t>(count) + 1, kCapacity) : 1;
    return count;
}

ReceiveBatch::Packet ReceiveBatch::packet(std::size_t index) const noexcept {
    const mmsghdr& entry = headers_[index];
    const msghdr& header = entry.msg_hdr;
    Packet packet;
    packet.bytes = std::as_bytes(std::span(&frames_[index], 1))
                       .first(std::min<std::size_t>(entry.msg_len, sizeof(canfd_frame)));
    packet.flags = header.msg_flags;
    for (const cmsghdr* c = CMSG_FIRSTHDR(&header); c != nullptr;
         c = CMSG_NXTHDR(const_cast<msghdr*>(&header), const_cast<cmsghdr*>(c))) {
        if (c->cmsg_level != SOL_SOCKET) continue;
        if (c->cmsg_type == SCM_TIMESTAMPNS) {
            timespec t{};
            std::memcpy(&t, CMSG_DATA(c), sizeof t);
            packet.stamp = t.tv_sec * kSecond + t.tv_nsec;
        } else if (c->cmsg_type == SO_RXQ_OVFL) {
            std::uint32_t overflows = 0;
            std::memcpy(&overflows, CMSG_DATA(c), sizeof overflows);
            packet.overflows = overflows;
        }
    }
    return packet;
}

}  // namespace vibrig::drivers
