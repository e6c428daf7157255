#pragma once

#include <optional>

#include "drivers/can/can_port.hpp"
#include "proto/dbc.hpp"

namespace vibrig::rt {

/// The simulated rig's time on the bus: messages RigTime and RigAck of proto/rig.dbc.
class RigTimeLink {
  public:
    struct Tick {
        drivers::Time time =
            0;             ///< of the daemon's clock: goes on where a restarted rig begins anew
        bool end = false;  ///< all frames of this instant have been sent
        std::int64_t rig_us = 0;  ///< as the rig said it, for the answer
    };

    explicit RigTimeLink(drivers::CanPort& port);

    /// True if the frame is the rig's time, whatever it says.
    [[nodiscard]] bool is_time(const canfd_frame& frame) const noexcept;
    /// The tick, unless it cannot be one: malformed, or a jump (backwards, or ahead by more than
    /// kLargestStep) that no second tick confirms. A stray frame must not move time for good.
    [[nodiscard]] std::optional<Tick> decode(const canfd_frame& frame) noexcept;
    /// Tells the rig that everything up to `tick` is done: the frame that was sent. None: not sent;
    /// the rig asks again.
    std::optional<canfd_frame> acknowledge(const Tick& tick) noexcept;

    static constexpr std::uint32_t kTimeId = 16;  ///< of RigTime in rig.dbc
    static constexpr std::int64_t kLargestStepUs = 10'000'000;

  private:
    drivers::CanPort& port_;
    proto::Dbc dbc_;
    std::int64_t last_us_ = -1;     ///< of the last tick taken; -1: none yet
    std::int64_t suspect_us_ = -1;  ///< of a tick that was not taken; -1: none
    std::int64_t offset_us_ = 0;    ///< daemon's time minus the rig's

    const proto::Message* tick_;
    const proto::Signal* tick_time_;
    const proto::Signal* tick_end_;
    const proto::Message* ack_;
    const proto::Signal* ack_time_;
};

}  // namespace vibrig::rt
