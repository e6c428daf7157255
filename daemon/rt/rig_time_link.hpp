#pragma once

#include <optional>

#include "drivers/can_port.hpp"
#include "proto/dbc.hpp"

namespace vibrig::rt {

/// The simulated rig's time on the bus: messages RigTime and RigAck of proto/rig.dbc.
class RigTimeLink {
  public:
    struct Tick {
        drivers::Time time = 0;
        bool end = false;  ///< all frames of this instant have been sent
    };

    explicit RigTimeLink(drivers::CanPort& port);

    [[nodiscard]] std::optional<Tick> decode(const canfd_frame& frame) const noexcept;
    /// Tells the rig that everything up to `time` is done. False: not sent; the rig asks again.
    bool acknowledge(drivers::Time time) noexcept;

  private:
    drivers::CanPort& port_;
    proto::Dbc dbc_;
    const proto::Message* tick_;
    const proto::Signal* tick_time_;
    const proto::Signal* tick_end_;
    const proto::Message* ack_;
    const proto::Signal* ack_time_;
};

}  // namespace vibrig::rt
