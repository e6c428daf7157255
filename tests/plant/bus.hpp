#pragma once

#include <linux/can.h>

#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <string>

namespace vibrig::plant {

constexpr std::size_t kBatch = 64;  ///< frames of one system call

/// The rig's end of a CAN bus. One thread.
class Bus {
  public:
    using Handler = std::function<void(const canfd_frame&)>;

    virtual ~Bus() = default;
    /// Readable when receive() has something to do.
    [[nodiscard]] virtual int descriptor() const noexcept = 0;
    /// Takes in what is there, without waiting.
    virtual void receive(const Handler& on_frame) = 0;
    /// With `wait` a full queue is waited for (up to a second), so that nothing is lost in
    /// lockstep.
    virtual void send(std::span<const can_frame> frames, bool wait) = 0;
    /// True if somebody is there, but nobody of those the last send() went to: the newcomers have
    /// missed it.
    [[nodiscard]] virtual bool only_newcomers() const noexcept = 0;
    /// False only if it is certain that nobody listens.
    [[nodiscard]] virtual bool somebody_there() const noexcept = 0;
    [[nodiscard]] virtual std::uint64_t dropped()
        const noexcept = 0;  ///< frames a full queue did not take
};

/// "seqpacket:PATH" listens on a Unix socket and is the hub of that bus ('@': abstract); anything
/// else is a SocketCAN interface. Throws PlantError.
[[nodiscard]] std::unique_ptr<Bus> open_bus(const std::string& address);

}  // namespace vibrig::plant
