#pragma once

#include <linux/can.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>

#include "drivers/base/clock.hpp"

namespace boost::asio {
class io_context;
}

namespace vibrig::drivers {

/// A port that waiting cannot mend: place (interface or path), what was found, what was expected.
class CanError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// One frame as the port received it. Classic frames have flags without CANFD_FDF.
struct ReceivedFrame {
    canfd_frame frame{};
    Time time = 0;     ///< kernel receive stamp carried to CLOCK_MONOTONIC, ns
    bool fd = false;   ///< came as a CAN FD frame
    bool own = false;  ///< this process sent it (loop-back of an own frame)
};

/// What the CAN controller reports of itself in error frames; a virtual one never does.
enum class ControllerState : std::uint8_t { active, warning, passive, bus_off };
[[nodiscard]] const char* name_of(ControllerState state) noexcept;

/// Counters of one port; received = delivered + own + error_frames + malformed. Read from any
/// thread.
struct CanPortCounters {
    std::uint64_t received = 0;        ///< frames and error frames taken from the kernel
    std::uint64_t delivered = 0;       ///< data frames handed to the handler (own ones not)
    std::uint64_t own = 0;             ///< own frames seen looped back
    std::uint64_t error_frames = 0;    ///< CAN_ERR_FLAG frames
    std::uint64_t malformed = 0;       ///< wrong size on the socket
    std::uint64_t kernel_dropped = 0;  ///< SO_RXQ_OVFL; not part of received
    std::uint64_t sent = 0;
    std::uint64_t send_failed = 0;
    std::uint64_t transitions = 0;  ///< changes of PortState
    ControllerState controller = ControllerState::active;
};

enum class PortState : std::uint8_t { absent, connecting, running, degraded, fault };
[[nodiscard]] const char* name_of(PortState state) noexcept;

struct CanPortSettings {
    enum class Kind : std::uint8_t { socketcan, seqpacket } kind = Kind::socketcan;
    std::string interface = "can0";  ///< socketcan: network interface
    std::string path;  ///< seqpacket: Unix socket to connect to, absolute, or "@name" for the
                       ///< abstract space
    bool fd = true;    ///< accept CAN FD frames
    int receive_buffer = 1 << 20;  ///< SO_RCVBUF, bytes
};

/// A CAN bus. start(), stop(), the destructor and the handlers belong to the one thread that runs
/// the io_context (or come while none runs it); send(), counters() and state() may be called in any
/// thread.
class CanPort {
  public:
    /// Up to 32 data frames in the order of arrival. Error frames and own frames are counted, not
    /// delivered here.
    using FrameHandler = std::function<void(std::span<const ReceivedFrame>)>;
    /// One call per change, with one line of text for the log ("vcan0: down (ENETDOWN), waiting").
    using StateHandler = std::function<void(PortState, const char* text)>;
    using ErrorHandler = std::function<void(const ReceivedFrame& error_frame)>;

    virtual ~CanPort() = default;
    /// Opens and from then on recovers alone. Throws CanError only for what waiting cannot mend
    /// (bad name, no permission).
    virtual void start(FrameHandler on_frames, StateHandler on_state, ErrorHandler on_error) = 0;
    virtual void stop() noexcept = 0;
    /// Hands one frame to the kernel without waiting. False: not sent (counted).
    [[nodiscard]] virtual bool send(const canfd_frame& frame, bool fd = false) noexcept = 0;
    [[nodiscard]] virtual CanPortCounters counters() const noexcept = 0;
    [[nodiscard]] virtual PortState state() const noexcept = 0;
};

/// Throws CanError: place (interface or path), value, what was expected.
[[nodiscard]] std::unique_ptr<CanPort> make_can_port(boost::asio::io_context& io,
                                                     const CanPortSettings& settings);

}  // namespace vibrig::drivers
