#include "drivers/can/can_port.hpp"

#include <array>

#include "drivers/can/can_port_base.hpp"
#include "proto/word_of.hpp"

namespace vibrig::drivers {

const char* name_of(ControllerState state) noexcept {
    static constexpr std::array kWords{"active", "warning", "passive", "bus off"};
    return proto::word_of(kWords, state, "unknown");
}

const char* name_of(PortState state) noexcept {
    static constexpr std::array kWords{"absent", "connecting", "running", "degraded", "fault"};
    return proto::word_of(kWords, state);
}

std::unique_ptr<CanPort> make_can_port(boost::asio::io_context& io,
                                       const CanPortSettings& settings) {
    return settings.kind == CanPortSettings::Kind::socketcan ? make_socketcan_port(io, settings)
                                                             : make_seqpacket_port(io, settings);
}

}  // namespace vibrig::drivers
