#include "daemon/configuration/key.hpp"
#include "daemon/configuration/rules.hpp"

namespace vibrig::configuration {

namespace {

using C = Configuration;

std::string program_rule(const std::string& text) {
    if (text.empty() || text.front() == '/') return path_rule(text);
    return "an absolute path, or \"\"";
}

}  // namespace

std::vector<Key> guard_keys() {
    using A = drivers::AnnunciatorSettings;
    using H = drivers::HornSettings;
    const auto annunciator = part(&C::annunciator);
    const auto horn = part(&C::annunciator, &A::horn);
    return {
        text("guard.socket", at(&C::guard_socket), "absolute or \"@name\"",
             "where vibrig-guard listens; without its word nothing is armed; empty: there is none",
             socket_or_empty_rule),
        text("annunciator.modbus.host", horn(&H::host), "a host name or numeric address, or \"\"",
             "device with horn and lamp as coils (Modbus/TCP); empty: none", host_or_empty_rule),
        integer("annunciator.modbus.port", horn(&H::port), "", 1, 65'535, "its port"),
        integer("annunciator.modbus.unit", horn(&H::unit), "", 1, 255,
                "its Modbus unit (slave) id"),
        integer("annunciator.modbus.horn_coil", horn(&H::horn_coil), "", 0, 65'535,
                "coil of the horn, from 0 as on the wire"),
        integer("annunciator.modbus.lamp_coil", horn(&H::lamp_coil), "", -1, 65'535,
                "coil of the lamp; -1: there is none"),
        text("annunciator.command", annunciator(&A::command), "an absolute path, or \"\"",
             "program that pages somebody, with JSON on its standard input; empty: none",
             program_rule),
        seconds("annunciator.command_limit_s", annunciator(&A::command_limit), {1, 600},
                "it is killed after so long, with its children"),
    };
}

}  // namespace vibrig::configuration
