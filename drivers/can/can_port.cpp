#include "drivers/can/can_port.hpp"

#include "drivers/can/can_port_base.hpp"

namespace vibrig::drivers {

const char* name_of(ControllerState state) noexcept {
    switch (state) {
        case ControllerState::active:
            return "active";
        case ControllerState::warning:
            return "warning";
        case ControllerState::passive:
            return "passive";
        case ControllerState::bus_off:
            return "bus off";
    }
    return "unknown";
}

const char* name_of(PortState state) noexcept {
    switch (state) {
        case PortState::absent:
            return "absent";
        case PortState::connecting:
            return "connecting";
        case PortState::running:
            return "running";
        case PortState::degraded:
            return "degraded";
        case PortState::fault:
            return "fault";
    }
    return "?";
}

std::unique_ptr<CanPort> make_can_port(boost::asio::io_context& io,
                                       const CanPortSettings& settings) {
    return settings.kind == CanPortSettings::Kind::socketcan ? make_socketcan_port(io, settings)
                                                             : make_seqpacket_port(io, settings);
}

}  // namespace vibrig::drivers
