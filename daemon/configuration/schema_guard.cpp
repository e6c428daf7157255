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

void add_guard_keys(std::vector<Key>& keys) {
    keys.push_back(text(
        "guard.socket", "absolute or \"@name\"",
        "where vibrig-guard listens; without its word nothing is armed; empty: there is none",
        socket_or_empty_rule, [](C & c) -> auto& { return c.guard_socket; }));
    keys.push_back(text(
        "annunciator.modbus.host", "a host name or numeric address, or \"\"",
        "device with horn and lamp as coils (Modbus/TCP); empty: none", host_or_empty_rule,
        [](C & c) -> auto& { return c.annunciator.horn.host; }));
    keys.push_back(integer("annunciator.modbus.port", "", 1, 65'535, "its port",
                           [](C& c) -> int& { return c.annunciator.horn.port; }));
    keys.push_back(integer("annunciator.modbus.unit", "", 1, 255, "its Modbus unit (slave) id",
                           [](C& c) -> int& { return c.annunciator.horn.unit; }));
    keys.push_back(integer("annunciator.modbus.horn_coil", "", 0, 65'535,
                           "coil of the horn, from 0 as on the wire",
                           [](C& c) -> int& { return c.annunciator.horn.horn_coil; }));
    keys.push_back(integer("annunciator.modbus.lamp_coil", "", -1, 65'535,
                           "coil of the lamp; -1: there is none",
                           [](C& c) -> int& { return c.annunciator.horn.lamp_coil; }));
    keys.push_back(text(
        "annunciator.command", "an absolute path, or \"\"",
        "program that pages somebody, told as JSON on its standard input; empty: none",
        program_rule, [](C & c) -> auto& { return c.annunciator.command; }));
    keys.push_back(seconds(
        "annunciator.command_limit_s", {1, 600}, "it is killed after so long, with its children",
        [](C & c) -> auto& { return c.annunciator.command_limit; }));
}

}  // namespace vibrig::configuration
