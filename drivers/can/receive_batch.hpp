#pragma once

#include <linux/can.h>
#include <sys/socket.h>
#include <sys/uio.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "drivers/base/clock.hpp"

namespace vibrig::drivers {

/// Both clocks read together, so that a kernel stamp can be carried from one to the other.
struct ClockPair {
    Time monotonic = 0;
    Time realtime = 0;
    [[nodiscard]] static ClockPair now() noexcept;
    /// A CLOCK_REALTIME stamp as CLOCK_MONOTONIC: its age, held within 0 to 1 s, before now. A step
    /// of the wall clock thus moves a frame by 1 s at most, and never into the future. Whole
    /// microseconds.
    [[nodiscard]] Time to_monotonic(Time realtime_stamp) const noexcept;
};

/// Up to 32 packets of one recvmmsg with their time stamps and drop counts. Nothing is allocated.
class ReceiveBatch {
  public:
    static constexpr std::size_t kCapacity = 32;

    struct Packet {
        std::span<const std::byte> bytes;
        int flags = 0;              ///< of recvmsg: MSG_TRUNC, MSG_CONFIRM, ...
        std::optional<Time> stamp;  ///< CLOCK_REALTIME, ns
        std::optional<std::uint32_t>
            overflows;  ///< SO_RXQ_OVFL: drops of the socket so far, mod 2^32
    };

    ReceiveBatch() noexcept;
    ReceiveBatch(const ReceiveBatch&) = delete;
    ReceiveBatch& operator=(const ReceiveBatch&) = delete;

    /// Packets taken without waiting; 0 or less: none, and errno says why.
    [[nodiscard]] int receive(int fd) noexcept;
    [[nodiscard]] Packet packet(std::size_t index) const noexcept;

  private:
    static constexpr std::size_t kControlBytes =
        128;  // time stamp, drop count and one unexpected message
    struct alignas(cmsghdr) Control {
        std::array<std::byte, kControlBytes> bytes;
    };

    std::array<canfd_frame, kCapacity> frames_{};
    std::array<Control, kCapacity> control_{};
    std::array<iovec, kCapacity> vectors_{};
    std::array<mmsghdr, kCapacity> headers_{};
    std::size_t touched_ = 0;  ///< headers whose control length the kernel has overwritten
};

}  // namespace vibrig::drivers
